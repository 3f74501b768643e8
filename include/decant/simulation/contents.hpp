// SPDX-License-Identifier: MIT
#pragma once

/// How much liquid is in a container, and where it came from.

#include <map>
#include <memory>

#include <decant/boundary/cavity.hpp>
#include <decant/core/expects.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>
#include <decant/simulation/simulator.hpp>

namespace decant::inline DECANT_TARGET {

/// The space of one container, ready for many questions. Which liquid is in it is asked in the container's own frame:
/// what is above the rim's plane is not, however the container is tilted.
class Contents {
 public:
  /// @param up the container's axis, out of its opening, in its own frame.
  template <class Parts>
  Contents(const Simulator<Parts>& simulator, BodyId body, const Vector3<double>& up = Vector3<double>::UnitZ())
      : body_(body) {
    expects(body < simulator.bodies().size(), "Contents: body", "one that was added", body);
    cavity_ = std::make_shared<const Cavity>(simulator.bodies()[body].surface, up);
    expects(!cavity_->empty(), "Contents: body '" + simulator.bodies()[body].name + "'", "one that holds liquid",
            "no cavity");
  }

  const Cavity& cavity() const noexcept { return *cavity_; }

  /// Volume of the liquid that is in the container now, by where it started [m^3].
  template <class Parts>
  std::map<Origin, double> by_origin(const Simulator<Parts>& simulator) const {
    const Pose body_from_world = simulator.bodies()[body_].motion.at(simulator.time()).inverse();
    const auto& fluid = simulator.fluid();
    std::map<Origin, double> volume;
    for (Index i = 0; i < fluid.size(); ++i) {
      const Vector3<double> x = fluid.position.col(i).template cast<double>();
      if (cavity_->contains(body_from_world * x)) {
        volume[fluid.origin[i]] += static_cast<double>(fluid.mass[i]) / simulator.settings().liquid.density;
      }
    }
    return volume;
  }

  /// All of it [m^3].
  template <class Parts>
  double volume(const Simulator<Parts>& simulator) const {
    double total = 0;
    for (const auto& share : by_origin(simulator)) {
      total += share.second;
    }
    return total;
  }

 private:
  BodyId body_;
  std::shared_ptr<const Cavity> cavity_;
};

}  // namespace decant::inline DECANT_TARGET
