// SPDX-License-Identifier: MIT
#pragma once

/// The bundle of types that a simulator is composed of. To replace a part, derive from a bundle and name that part:
///   struct MyParts : decant::DefaultParts<> { using Kernel = decant::WendlandC2<float>; };

#include <tuple>

#include <decant/boundary/rigid_bodies.hpp>
#include <decant/core/domain.hpp>
#include <decant/core/target.hpp>
#include <decant/force/gravity.hpp>
#include <decant/force/residual_viscosity.hpp>
#include <decant/force/surface_tension.hpp>
#include <decant/force/surface_tension_schenck2017.hpp>
#include <decant/force/viscosity.hpp>
#include <decant/force/viscosity_schenck2017.hpp>
#include <decant/force/viscosity_weiler2018.hpp>
#include <decant/kernel/cubic_spline.hpp>
#include <decant/neighbor/cell_grid.hpp>
#include <decant/pressure/dfsph.hpp>
#include <decant/pressure/position_based.hpp>
#include <decant/pressure/state_equation.hpp>
#include <decant/pressure/state_equation_schenck2017.hpp>

namespace decant::inline DECANT_TARGET {

/// Incompressible liquid with standard, momentum-conserving forces. `float` holds micrometres over metres and is twice
/// as fast; take `double` for analysis. Surface tension is left out: at spacings above a millimetre or two, water's
/// capillary length (2.7 mm) is below what particles resolve; CapillaryParts has it.
template <class ScalarType = float>
struct DefaultParts {
  using Scalar = ScalarType;
  using Domain = OpenDomain;
  using Kernel = CubicSpline<Scalar>;
  using NeighborSearch = CellGrid<Scalar, Domain>;
  using Forces = std::tuple<Gravity<Scalar>, Viscosity<Scalar>, ResidualViscosity<Scalar>>;
  using PressureSolver = Dfsph<Scalar>;
  using Boundary = RigidBodies<Scalar>;
};

/// In a box that repeats itself: Simulator<PeriodicParts<>>(settings, PeriodicDomain<float>({length, 0, 0})).
template <class ScalarType = float>
struct PeriodicParts : DefaultParts<ScalarType> {
  using Domain = PeriodicDomain<ScalarType>;
  using NeighborSearch = CellGrid<ScalarType, Domain>;
};

/// With surface tension, for drops and thin jets.
template <class ScalarType = float>
struct CapillaryParts : DefaultParts<ScalarType> {
  using Forces =
      std::tuple<Gravity<ScalarType>, Viscosity<ScalarType>, ResidualViscosity<ScalarType>, SurfaceTension<ScalarType>>;
};

/// For thick liquids (kinematic viscosity above about 1e-2 m^2/s): implicit viscosity.
template <class ScalarType = float>
struct ThickLiquidParts : DefaultParts<ScalarType> {
  using Forces = std::tuple<Gravity<ScalarType>, ViscosityWeiler2018<ScalarType>, ResidualViscosity<ScalarType>>;
};

/// Weakly compressible: explicit steps limited by the speed of sound, cheap ones.
template <class ScalarType = float>
struct StateEquationParts : DefaultParts<ScalarType> {
  using PressureSolver = StateEquation<ScalarType>;
};

/// Position-based fluids.
template <class ScalarType = float>
struct PositionBasedParts : DefaultParts<ScalarType> {
  using PressureSolver = PositionBased<ScalarType>;
};

/// Every formula as Schenck and Fox 2017 print it (see the headers for what differs from the standard forms).
template <class ScalarType = float>
struct Schenck2017Parts : DefaultParts<ScalarType> {
  using Forces =
      std::tuple<Gravity<ScalarType>, ViscositySchenck2017<ScalarType>, SurfaceTensionSchenck2017<ScalarType>>;
  using PressureSolver = StateEquationSchenck2017<ScalarType>;
};

}  // namespace decant::inline DECANT_TARGET
