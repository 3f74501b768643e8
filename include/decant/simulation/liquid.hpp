// SPDX-License-Identifier: MIT
#pragma once

/// What a liquid is made of, and a small table of real ones.

#include <cmath>
#include <string_view>

#include <decant/core/expects.hpp>
#include <decant/core/target.hpp>

namespace decant::inline DECANT_TARGET {

/// Bulk properties of a Newtonian liquid against air.
struct Liquid {
  double density = 998.2;                ///< [kg/m^3], > 0
  double dynamic_viscosity = 1.0016e-3;  ///< mu [Pa s], >= 0
  double surface_tension = 0.07274;      ///< sigma [N/m], >= 0

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

/// Real liquids at 20 degrees Celsius and 1 bar. Water and glycerol are as their sources have them. The others differ
/// from bottle to bottle: their values are typical ones, rounded, in the range of what the works named measured.
namespace liquids {

/// IAPWS: density R6-95, viscosity R12-08, surface tension R1-76, each evaluated at 293.15 K.
inline constexpr Liquid water{998.2, 1.0016e-3, 0.07274};
/// Typical: Coupland and McClements 1997 (J. Am. Oil Chem. Soc. 74:1559) compile density and viscosity of edible oils,
/// Sahasrabudhe et al. 2017 (Int. J. Food Prop. 20) measure the tension.
inline constexpr Liquid olive_oil{911.0, 0.084, 0.0320};
/// Free of water; a hundredth of water makes it a fifth thinner. Viscosity: Segur and Oberstar 1951 (Ind. Eng. Chem.
/// 43:2117, table of viscosities, 100 %). Density and tension: CRC Handbook of Chemistry and Physics, tables of organic
/// compounds and of surface tensions.
inline constexpr Liquid glycerol{1261.3, 1.410, 0.0634};
/// Typical of liquid honey of 17 to 18 % water, after White 1975 (in Crane, Honey: A Comprehensive Survey, chapter 5):
/// clover honey of 16 % has 19 Pa s, each further per cent takes off a third. Tension: of honeys, 0.05 to 0.06 (Oroian
/// 2013, J. Food Eng. 119:167, measures several).
inline constexpr Liquid honey{1420.0, 10.0, 0.060};
/// Typical of whole milk of 4 % fat; Sherbon 1988 (in Wong et al., Fundamentals of Dairy Chemistry, 3rd edition,
/// chapter 8) reviews density and viscosity. Tension: Bertsch 1983 (J. Dairy Res. 50:259, equation of the summary,
/// scatter 0.002); of homogenised milk some measure 0.045.
inline constexpr Liquid milk{1030.0, 2.1e-3, 0.0524};

}  // namespace liquids

}  // namespace decant::inline DECANT_TARGET
