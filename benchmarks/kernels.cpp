// SPDX-License-Identifier: MIT
/// Smoothing kernels, in batches and one distance after another; and what it costs to write one's own: copies of two
/// shipped kernels, as a user would write them. Times are per distance, of 4,096 that stay in the nearest cache.

#include <cstddef>
#include <string>
#include <type_traits>
#include <vector>

#include <decant/core/batch.hpp>
#include <decant/kernel/cubic_spline.hpp>
#include <decant/kernel/mueller_viscosity.hpp>
#include <decant/kernel/poly6.hpp>
#include <decant/kernel/spiky.hpp>
#include <decant/kernel/wendland_c2.hpp>
#include <decant/kernel/wendland_c4.hpp>

#include "common.hpp"
#include "inputs.hpp"

namespace {

using namespace decant_benchmark;

// ---- a user's copies ------------------------------------------------------------------------------------------------

struct OwnCubicSpline {
  using Scalar = float;
  static constexpr float support_factor = 2, pi = 3.14159265f;

  template <class Number>
  static Number value(Number r, float h) noexcept {
    const Number q = r * (1 / h), far = decant::maximum(2 - q, 0.0f), near = decant::maximum(1 - q, 0.0f);
    return (far * far * far - 4 * near * near * near) * (1 / (4 * pi * h * h * h));
  }
  template <class Number>
  static Number derivative(Number r, float h) noexcept {
    return r * derivative_over_radius(r, h);
  }
  template <class Number>
  static Number derivative_over_radius(Number r, float h) noexcept {
    const Number q = r * (1 / h), outside = decant::maximum(q, 1.0f), far = decant::maximum(2 - outside, 0.0f);
    return (far * far / outside + 3 * decant::maximum(1 - q, 0.0f)) * (-3 / (4 * pi * h * h * h * h * h));
  }
};
static_assert(decant::SmoothingKernel<OwnCubicSpline>);

struct OwnWendlandC2 {
  using Scalar = float;
  static constexpr float support_factor = 2, pi = 3.14159265f;

  template <class Number>
  static Number value(Number r, float h) noexcept {
    const Number q = r * (1 / h), t = decant::maximum(1 - 0.5f * q, 0.0f), t2 = t * t;
    return t2 * t2 * (1 + 2 * q) * (21 / (16 * pi * h * h * h));
  }
  template <class Number>
  static Number derivative(Number r, float h) noexcept {
    return r * derivative_over_radius(r, h);
  }
  template <class Number>
  static Number derivative_over_radius(Number r, float h) noexcept {
    const Number t = decant::maximum(1 - r * (0.5f / h), 0.0f);
    return t * t * t * (-105 / (16 * pi * h * h * h * h * h));
  }
};
static_assert(decant::SmoothingKernel<OwnWendlandC2>);

// ---- measuring ------------------------------------------------------------------------------------------------------

constexpr std::size_t distance_count = 4096;

// All of the support and a little more, in no order.
template <class Scalar>
std::vector<std::vector<Scalar>> distances(Scalar support) {
  std::vector<std::vector<Scalar>> inputs(input_count, std::vector<Scalar>(distance_count));
  for (std::size_t input = 0; input < input_count; ++input) {
    for (std::size_t k = 0; k < distance_count; ++k) {
      const std::size_t mixed = k * (2654435761u + 2 * input) % distance_count;  // an odd factor permutes
      inputs[input][k] = Scalar(1.1) * support * static_cast<Scalar>(mixed) / static_cast<Scalar>(distance_count);
    }
  }
  return inputs;
}

/// A function of the distance, in batches or one by one.
template <class Scalar>
class Evaluations {
 public:
  explicit Evaluations(Scalar h) : r_(distances<Scalar>(2 * h)), result_(distance_count) {}

  template <class Function>
  Comparison::Call in_batches(Function f) {
    return [this, f](std::size_t turn) {
      using B = decant::Batch<Scalar>;
      const std::vector<Scalar>& r = r_[turn % input_count];
      for (std::size_t k = 0; k < distance_count; k += B::width) {
        f(B::load(&r[k])).store(&result_[k]);
      }
      keep(result_);
    };
  }
  template <class Function>
  Comparison::Call one_by_one(Function f) {
    return [this, f](std::size_t turn) {
      const std::vector<Scalar>& r = r_[turn % input_count];
      for (std::size_t k = 0; k < distance_count; ++k) {
        result_[k] = f(r[k]);
        keep(result_[k]);  // or the compiler makes batches of its own
      }
    };
  }

 private:
  std::vector<std::vector<Scalar>> r_;
  std::vector<Scalar> result_;
};

constexpr Unit ns_per_distance{"ns", 1e9 / distance_count};

/// One of a kernel's functions: batches are the reference.
template <class Scalar, class Function, class OwnFunction = std::nullptr_t>
void measure(Report& report, const std::string& title, Scalar h, Function f, OwnFunction own = nullptr) {
  Evaluations<Scalar> evaluations(h);
  Comparison comparison(report, title, static_cast<long>(distance_count), 1, ns_per_distance);
  comparison.add("batches", evaluations.in_batches(f));
  comparison.add("one by one", evaluations.one_by_one(f));
  if constexpr (!std::is_same_v<OwnFunction, std::nullptr_t>) {
    comparison.add("a user's copy, batches", evaluations.in_batches(own));
    // against the shipped one in the same way
    Comparison single(report, title + ", one by one", static_cast<long>(distance_count), 1, ns_per_distance);
    single.add("shipped", evaluations.one_by_one(f));
    single.add("a user's copy", evaluations.one_by_one(own));
    comparison.run();
    single.run();
  } else {
    comparison.run();
  }
}

template <class Kernel, class OwnKernel = void>
void measure_kernel(Report& report, const std::string& name) {
  using Scalar = typename Kernel::Scalar;
  const Scalar h = Scalar(0.005);
  const std::string type = sizeof(Scalar) == 4 ? " float" : " double";
  const auto value = [h](auto r) { return Kernel::value(r, h); };
  const auto slope = [h](auto r) { return Kernel::derivative_over_radius(r, h); };
  if constexpr (std::is_void_v<OwnKernel>) {
    measure(report, name + " value" + type, h, value);
    measure(report, name + " derivative over radius" + type, h, slope);
  } else {
    measure(report, name + " value" + type, h, value, [h](auto r) { return OwnKernel::value(r, h); });
    measure(report, name + " derivative over radius" + type, h, slope,
            [h](auto r) { return OwnKernel::derivative_over_radius(r, h); });
  }
}

template <class Scalar>
void measure_others(Report& report) {
  measure_kernel<decant::WendlandC4<Scalar>>(report, "WendlandC4");
  measure_kernel<decant::Poly6<Scalar>>(report, "Poly6");
  measure_kernel<decant::Spiky<Scalar>>(report, "Spiky");
  measure_kernel<decant::MuellerViscosity<Scalar>>(report, "MuellerViscosity");
}

}  // namespace

int main(int argc, char** argv) {
  Options options("bench_kernels", "smoothing kernels, shipped ones and a user's copies of two");
  options.add("seconds", "0.1", "time for each case [s]; at least 7 rounds are run");
  return benchmark_main(argc, argv, options, [](const Options&, Report& report) {
    measure_kernel<decant::CubicSpline<float>, OwnCubicSpline>(report, "CubicSpline");
    measure_kernel<decant::WendlandC2<float>, OwnWendlandC2>(report, "WendlandC2");
    measure_others<float>(report);
    measure_kernel<decant::CubicSpline<double>>(report, "CubicSpline");
    measure_kernel<decant::WendlandC2<double>>(report, "WendlandC2");
    measure_others<double>(report);
  });
}
