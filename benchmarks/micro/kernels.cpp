// SPDX-License-Identifier: MIT
/// Times the smoothing kernels, one distance after another and in batches. The time is for 4,096 distances, which stay
/// in the nearest cache.

#include <vector>

#include <decant/kernel/cubic_spline.hpp>
#include <decant/kernel/mueller_viscosity.hpp>
#include <decant/kernel/poly6.hpp>
#include <decant/kernel/spiky.hpp>
#include <decant/kernel/wendland_c2.hpp>
#include <decant/kernel/wendland_c4.hpp>

#include "common.hpp"

namespace {

using namespace decant_benchmark;

constexpr std::size_t distances = 4096;

template <class Kernel>
void run(Csv& csv, const std::string& name) {
  using Scalar = typename Kernel::Scalar;
  using B = decant::Batch<Scalar>;
  const Scalar h = Scalar(0.005);
  std::vector<Scalar> r(distances), result(distances);
  for (std::size_t k = 0; k < distances; ++k) {  // all of the support and a little more, in no order
    r[k] = static_cast<Scalar>(1.1 * Kernel::support_factor) * h * static_cast<Scalar>(k * 2654435761u % distances) /
           static_cast<Scalar>(distances);
  }
  const auto time = [&](const std::string& what, auto&& f) {
    csv.row(name + " " + what + (sizeof(Scalar) == 4 ? " float" : " double") + " batch", 1, distances, 0,
            time_of(
                [&] {
                  for (std::size_t k = 0; k < distances; k += B::width) {
                    f(B::load(&r[k])).store(&result[k]);
                  }
                  keep(result);
                },
                0.1));
    csv.row(name + " " + what + (sizeof(Scalar) == 4 ? " float" : " double") + " one by one", 1, distances, 0,
            time_of(
                [&] {
                  for (std::size_t k = 0; k < distances; ++k) {
                    result[k] = f(r[k]);
                    keep(result[k]);  // or the compiler makes batches of its own
                  }
                },
                0.1));
  };
  time("value", [h](auto x) { return Kernel::value(x, h); });
  time("derivative_over_radius", [h](auto x) { return Kernel::derivative_over_radius(x, h); });
}

template <class Scalar>
void run_all(Csv& csv) {
  run<decant::CubicSpline<Scalar>>(csv, "CubicSpline");
  run<decant::WendlandC2<Scalar>>(csv, "WendlandC2");
  run<decant::WendlandC4<Scalar>>(csv, "WendlandC4");
  run<decant::Poly6<Scalar>>(csv, "Poly6");
  run<decant::Spiky<Scalar>>(csv, "Spiky");
  run<decant::MuellerViscosity<Scalar>>(csv, "MuellerViscosity");
}

}  // namespace

int main() {
  Csv csv;
  run_all<float>(csv);
  run_all<double>(csv);
}
