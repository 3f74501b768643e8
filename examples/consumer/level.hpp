// SPDX-License-Identifier: MIT
#pragma once

#include <decant/core/fluid_state.hpp>

/// Density [kg/m^3] that the particles of a liquid make at a point, with smoothing length h [m].
double density_at(const decant::Vector3<double>& x, const decant::FluidState<double>& fluid, double h);
