// SPDX-License-Identifier: MIT
#pragma once

/// What a liquid is made of, and a small table of real ones.

#include <cmath>
#include <string_view>

#include <decant/core/expects.hpp>

namespace decant {

/// Bulk properties of a Newtonian liquid against air.
struct Liquid {
  double density = 998.2;                ///< [kg/m^3], > 0
  double dynamic_viscosity = 1.0016e-3;  ///< mu [Pa s], >= 0
  double surface_tension = 0.07275;      ///< sigma [N/m], >= 0

  /// nu = mu / rho [m^2/s].
  double kinematic_viscosity() const { return dynamic_viscosity / density; }
};

/// Throws std::invalid_argument if a property is out of range.
inline void validate(const Liquid& liquid) {
  expects(std::isfinite(liquid.density) && liquid.density > 0 && liquid.density < 1e5, "Liquid: density [kg/m^3]",
          "> 0 and < 1e5", liquid.density);
  expects(liquid.dynamic_viscosity >= 0 && liquid.dynamic_viscosity < 1e6, "Liquid: dynamic viscosity [Pa s]",
          ">= 0 and < 1e6", liquid.dynamic_viscosity);
  expects(liquid.surface_tension >= 0 && liquid.surface_tension < 100, "Liquid: surface tension [N/m]",
          ">= 0 and < 100", liquid.surface_tension);
}

/// Real liquids at 20 degrees Celsius; values as commonly tabulated, with the works that treat them. Honey varies by a
/// factor of ten with its water content; milk with its fat.
namespace liquids {

/// IAPWS formulations (density, viscosity R12-08, surface tension R1-76).
inline constexpr Liquid water{998.2, 1.0016e-3, 0.07275};
/// Olive oil: density and viscosity after Noureddini et al. 1992 (J. Am. Oil Chem. Soc. 69), tension after Sahasrabudhe
/// et al. 2017 (Int. J. Food Prop. 20).
inline constexpr Liquid olive_oil{911.0, 0.084, 0.0320};
/// Segur and Oberstar 1951 (Ind. Eng. Chem. 43) for the viscosity; CRC Handbook for density and tension.
inline constexpr Liquid glycerol{1261.3, 1.412, 0.0634};
/// Clover honey of 17 % water: density and viscosity after Yanniotis et al. 2006 (J. Food Eng. 72), tension after
/// Oroian 2013 (J. Food Eng. 119).
inline constexpr Liquid honey{1420.0, 10.0, 0.0605};
/// Whole milk: Walstra, Wouters, Geurts 2006 (Dairy Science and Technology).
inline constexpr Liquid milk{1030.0, 2.1e-3, 0.0470};

}  // namespace liquids

}  // namespace decant
