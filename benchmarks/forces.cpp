// SPDX-License-Identifier: MIT
/// Force terms: what one call of accumulate takes, on liquid in general position that is sheared and jitters, spacing 5
/// mm, support 10 mm, without walls; and what it costs to write one's own: a copy of Viscosity as a user would write
/// it, in batches and pair by pair. The reference is the least that a sweep over the pairs can do: it adds up a number
/// of each neighbour.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include <decant/force/gravity.hpp>
#include <decant/force/linear_drag.hpp>
#include <decant/force/residual_viscosity.hpp>
#include <decant/force/shear_thinning_viscosity.hpp>
#include <decant/force/surface_tension.hpp>
#include <decant/force/surface_tension_schenck2017.hpp>
#include <decant/force/viscosity.hpp>
#include <decant/force/viscosity_schenck2017.hpp>
#include <decant/force/viscosity_weiler2018.hpp>
#include <decant/kernel/cubic_spline.hpp>
#include <decant/neighbor/cell_grid.hpp>
#include <decant/testing/force.hpp>

#include "common.hpp"
#include "inputs.hpp"

namespace {

using namespace decant_benchmark;
using decant::PointArray;
using Scalar = float;
using B = decant::Batch<Scalar>;
using Liquid = decant::testing::LooseLiquid<decant::CubicSpline<Scalar>>;

// ---- a user's copies ------------------------------------------------------------------------------------------------

struct OwnViscosity {
  float kinematic_viscosity = 1e-6f;
  Eigen::Matrix4Xf v{};  // velocities in records of four, the last one unused

  template <class Step>
  void accumulate(const Step& step, PointArray<float>& acceleration) noexcept {
    v.resize(4, step.fluid.size());
    decant::parallel_for(v.cols(), step.threads, [&](Index i) { v.col(i).head<3>() = step.fluid.velocity.col(i); });
    const float R = 2 * step.smoothing_length, scale = 225 * kinematic_viscosity / (3.14159265f * step.rest_density);
    decant::parallel_for(v.cols(), step.threads, [&](Index i) {
      B x(0), y(0), z(0);
      step.neighbors.for_each_batch(i, [&, own = v.col(i)](const auto& pair) {
        const auto other = decant::gather3(v.data(), pair.neighbor);
        const B v_dot_x = (own[0] - other.x) * pair.x + (own[1] - other.y) * pair.y + (own[2] - other.z) * pair.z;
        const B hat = maximum(1 - square_root(pair.distance_squared) * (1 / R), B(0));
        const B push = step.mass(pair.neighbor) * v_dot_x * hat / (pair.distance_squared + 1e-6f * R * R);
        x += push * pair.x, y += push * pair.y, z += push * pair.z;
      });
      acceleration.col(i) -= scale / (R * R * R * R * R) * decant::Vector3<float>(sum(x), sum(y), sum(z));
    });
  }
};

// The same without batches: the shortest that is right.
struct OwnViscosityByPairs {
  float kinematic_viscosity = 1e-6f;

  template <class Step>
  void accumulate(const Step& step, PointArray<float>& acceleration) noexcept {
    const float R = 2 * step.smoothing_length, scale = 225 * kinematic_viscosity / (3.14159265f * step.rest_density);
    decant::parallel_for(step.fluid.size(), step.threads, [&](Index i) {
      decant::Vector3<float> total(0, 0, 0);
      step.neighbors.for_each(i, [&](Index j, const decant::Vector3<float>& x_ij, float r_squared) {
        const float v_dot_x = (step.fluid.velocity.col(i) - step.fluid.velocity.col(j)).dot(x_ij);
        const float hat = std::max(1 - std::sqrt(r_squared) / R, 0.0f);
        total += step.fluid.mass[j] * v_dot_x * hat / (r_squared + 1e-6f * R * R) * x_ij;
      });
      acceleration.col(i) -= scale / (R * R * R * R * R) * total;
    });
  }
};

// ---- measuring ------------------------------------------------------------------------------------------------------

/// One number of each neighbour, added up.
struct LeastSweep {
  std::vector<Scalar> term{};

  template <class Step>
  void accumulate(const Step& step, PointArray<Scalar>& acceleration) noexcept {
    term.resize(static_cast<std::size_t>(step.fluid.size()), Scalar(1));
    decant::parallel_for(step.fluid.size(), step.threads, [&](Index i) {
      B total(0);
      step.neighbors.for_each_batch(i, [&](const auto& pair) { total += decant::gather(term.data(), pair.neighbor); });
      acceleration(0, i) += sum(total);
    });
  }
};

/// Liquids that take turns, and an acceleration for each call to add to.
class Inputs {
 public:
  Inputs(int per_edge, int threads) {
    for (const PointArray<Scalar>& position : sorted_liquids<Scalar>(per_edge, 0.005, inputs_for(per_edge))) {
      auto liquid = std::make_unique<Liquid>();
      liquid->threads = {threads};
      liquid->place<decant::CellGrid<Scalar>>(position);
      liquid->fluid.velocity = Scalar(0.05) * PointArray<Scalar>::Random(3, position.cols());
      liquid->fluid.velocity.row(0) += 5 * liquid->fluid.position.row(1);  // shear
      liquid->fluid.pressure.setConstant(1000);
      acceleration_.setZero(3, position.cols());
      liquids_.push_back(std::move(liquid));
    }
  }

  template <class Force>
  PointArray<Scalar> acceleration_by(Force force) {
    PointArray<Scalar> result = PointArray<Scalar>::Zero(3, size());
    force.accumulate(liquids_[0]->view(), result);
    return result;
  }

  template <class Force>
  Comparison::Call accumulate(const Force& force) {
    return [this, own = force](std::size_t turn) mutable {
      own.accumulate(liquids_[turn % liquids_.size()]->view(), acceleration_);
      keep(acceleration_);
    };
  }

  Index size() const { return liquids_[0]->fluid.size(); }

 private:
  std::vector<std::unique_ptr<Liquid>> liquids_{};
  PointArray<Scalar> acceleration_{};
};

void measure(Report& report, int per_edge, int threads) {
  Inputs inputs(per_edge, threads);
  const long size = inputs.size();

  Comparison shipped(report, "force terms", size, threads);
  const auto add = [&](const std::string& name, const auto& force) -> auto& {
    return shipped.add(name, inputs.accumulate(force));
  };
  add("least sweep over the pairs", LeastSweep{});
  add("Gravity", decant::Gravity<Scalar>{});
  add("LinearDrag", decant::LinearDrag<Scalar>{.rate = 1});
  add("Viscosity", decant::Viscosity<Scalar>{});
  add("ShearThinningViscosity that does not thin", decant::ShearThinningViscosity<Scalar>{});
  decant::ShearThinningViscosity<Scalar> of_ketchup;
  of_ketchup.kinematic_viscosity = Scalar(1e-2);
  of_ketchup.relaxation_time = 1;
  of_ketchup.exponent = Scalar(0.4);
  add("ShearThinningViscosity", of_ketchup);
  add("ResidualViscosity", decant::ResidualViscosity<Scalar>{});
  add("SurfaceTension", decant::SurfaceTension<Scalar>{});
  decant::ViscosityWeiler2018<Scalar> of_honey;
  of_honey.kinematic_viscosity = Scalar(7e-3);
  add("ViscosityWeiler2018, of honey", of_honey);
  add("ViscositySchenck2017", decant::ViscositySchenck2017<Scalar>{});
  add("SurfaceTensionSchenck2017", decant::SurfaceTensionSchenck2017<Scalar>{});
  shipped.run();

  decant::Viscosity<Scalar> viscosity;
  viscosity.kinematic_viscosity = OwnViscosity{}.kinematic_viscosity;
  const PointArray<Scalar> expected = inputs.acceleration_by(viscosity);
  for (const auto& own : {inputs.acceleration_by(OwnViscosity{}), inputs.acceleration_by(OwnViscosityByPairs{})}) {
    decant::expects((own - expected).norm() < 1e-4f * expected.norm(), "bench_forces: error of a user's copy",
                    "below 1e-4", (own - expected).norm() / expected.norm());
  }
  Comparison own(report, "a user's copy of Viscosity", size, threads);
  own.add("Viscosity", inputs.accumulate(viscosity));
  own.add("a user's copy, in batches", inputs.accumulate(OwnViscosity{}));
  own.add("a user's copy, pair by pair", inputs.accumulate(OwnViscosityByPairs{}));
  own.run();
}

}  // namespace

int main(int argc, char** argv) {
  Options options("bench_forces", "force terms, shipped ones and a user's copies of one");
  options.add_threads().add("sizes", "20,40", "particles per edge of a cube of liquid");
  return benchmark_main(argc, argv, options, [](const Options& given, Report& report) {
    for (const int per_edge : given.numbers("sizes")) {
      for (const int threads : given.numbers("threads")) {
        measure(report, per_edge, threads);
      }
    }
  });
}
