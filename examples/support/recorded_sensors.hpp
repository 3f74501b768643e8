// SPDX-License-Identifier: MIT
#pragma once

/// Scalar measurements of a recording, and what a simulation would read in their place.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <map>
#include <memory>
#include <set>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <decant/boundary/bounding_volume_hierarchy.hpp>
#include <decant/boundary/cavity.hpp>
#include <decant/core/types.hpp>
#include <decant/discovery/reading_series.hpp>
#include <decant/discovery/simulated_interaction.hpp>
#include <decant/io/recording.hpp>
#include <decant/simulation/gauges.hpp>

#include "pour_places.hpp"
#include "stands_within.hpp"

namespace example {

namespace detail {

/// Of a channel, the mean around each of some times: sensors have noise, and are read more often than cameras. Not
/// finite where there is none.
inline std::vector<double> averaged(const std::vector<double>& at, const std::vector<double>& values,
                                    const std::vector<double>& times) {
  std::vector<double> result;
  for (std::size_t k = 0; k < times.size(); ++k) {
    const double before = k > 0 ? times[k] - times[k - 1] : times.size() > 1 ? times[1] - times[0] : 0;
    const double after = k + 1 < times.size() ? times[k + 1] - times[k] : before;
    double sum = 0;
    int count = 0;
    for (std::size_t sample = 0; sample < at.size(); ++sample) {
      const bool near = at[sample] > times[k] - 0.5 * before - 1e-9 && at[sample] < times[k] + 0.5 * after - 1e-9;
      if (near && std::isfinite(values[sample])) {
        sum += values[sample];
        ++count;
      }
    }
    result.push_back(count > 0 ? sum / count : std::numeric_limits<double>::quiet_NaN());
  }
  return result;
}

}  // namespace detail

/// A channel's name without its place.
inline std::string kind_of_channel(const std::string& name) { return name.substr(0, name.find('@')); }

/// What readings are off by as a rule, a model of particles included, and for how long: in kg, m and Pa.
/// @param channel as the format names it, without its place. Throws std::runtime_error for one that is not compared.
inline decant::ReadingError usual_reading_error(const std::string& channel) {
  static const std::map<std::string, decant::ReadingError> usual{
      {"target_mass_g", {2e-3, 0.3}}, {"level_mm", {3e-3, 0.3}},  {"front_mm", {6e-3, 0.3}},
      {"top_mm", {3e-3, 0.3}},        {"height_mm", {3e-3, 0.3}}, {"pressure_pa", {150, 0.1}}};
  const auto found = usual.find(channel);
  if (found == usual.end()) {
    throw std::runtime_error("error of '" + channel +
                             "': expected one of target_mass_g, level_mm, front_mm, top_mm, height_mm and pressure_pa");
  }
  return found->second;
}

/// Kinds of a recording's sensors that may show too much or too little. A scale does not: it is calibrated to better
/// than anything else here.
inline std::set<std::string> uncertain_gains(const decant::Recording& recording) {
  std::set<std::string> kinds;
  for (const decant::recording::Channel& channel : recording.measurements.channels) {
    const std::string kind = kind_of_channel(channel.name);
    if (kind == "level_mm" || kind == "front_mm" || kind == "top_mm" || kind == "height_mm" || kind == "pressure_pa") {
      kinds.insert(kind);
    }
  }
  return kinds;
}

/// The sensors of a recording as a simulation has them, and what they read in some frames. Beside the channels that the
/// format lists there are height_mm@BODY, the liquid's highest point along a body's z axis, and top_mm@BODY, the same
/// above what it was in the first frame. Others are passed over. Where a simulation has no liquid, a sensor reads what
/// it reads at least.
/// @param times of the frames [s]. @param errors by channel, as the format names them and in its units: standard
/// deviations in place of the usual ones. @param planned sensors that read nothing are not passed over: they will.
/// Throws std::runtime_error for errors of channels that there are not, and for the top in a body that there is not.
template <class Model>
std::pair<std::vector<decant::InteractionSensor<Model>>, std::vector<decant::ReadingSeries>> recorded_sensors(
    const decant::Recording& recording, const std::vector<double>& times, const detail::PourPlaces& places,
    const std::map<std::string, double>& errors = {}, bool planned = false) {
  using namespace decant;
  using recording::Quantity;
  for (const auto& [channel, error] : errors) {
    usual_reading_error(channel);  // throws where there is none
    if (!(error > 0)) {
      throw std::runtime_error("error of '" + channel + "': expected a number above 0");
    }
  }
  // containers whose liquid a scale weighs; made where there is one
  const auto weighed = [&] {
    std::vector<std::pair<BodyId, std::shared_ptr<const Cavity>>> targets;
    for (std::size_t body = 0; body < recording.bodies.size(); ++body) {
      if (recording.bodies[body].role == recording::Role::Target && places.inside.at(body)) {
        const auto surface = std::make_shared<const BoundingVolumeHierarchy>(recording.bodies[body].mesh);
        targets.emplace_back(static_cast<BodyId>(body),
                             std::make_shared<const Cavity>(surface, places.inside[body]->up));
      }
    }
    return targets;
  };
  std::vector<InteractionSensor<Model>> sensors;
  std::vector<ReadingSeries> readings;
  for (const recording::Channel& channel : recording.measurements.channels) {
    const bool of_top = channel.quantity == Quantity::Other &&
                        (channel.name.starts_with("top_mm@") || channel.name.starts_with("height_mm@"));
    if (channel.quantity == Quantity::Other && !of_top) {
      continue;
    }
    std::vector<double> values = detail::averaged(recording.measurements.times, channel.values, times);
    double least = std::numeric_limits<double>::infinity();
    for (const double value : values) {
      least = std::isfinite(value) ? std::min(least, value) : least;
    }
    if (!std::isfinite(least)) {
      if (!planned) {
        continue;
      }
      least = 0;
    }
    InteractionSensor<Model> sensor;
    sensor.name = channel.name;
    const std::string kind = kind_of_channel(channel.name);
    sensor.error = usual_reading_error(kind);
    if (const auto own = errors.find(kind); own != errors.end()) {
      sensor.error.deviation = own->second * (channel.quantity == Quantity::Pressure ? 1 : 1e-3);
    }
    using Scalar = typename Model::Scalar;
    const auto gauges = [](Model& model) {
      Gauges<Scalar> of(model.spacing());
      of.observe(model.fluid(), {1});
      return of;
    };
    const Vector3<double> at = channel.place;
    if (channel.quantity == Quantity::TargetMass) {
      const auto targets = weighed();
      if (targets.empty()) {
        continue;
      }
      sensor.read = [gauges, targets](Model& model) {
        const Gauges<Scalar> of = gauges(model);
        double volume = 0;
        for (const auto& [body, cavity] : targets) {
          volume += of.volume_in(*cavity, model.bodies()[body].motion.at(model.time()));
        }
        return model.settings().liquid.density * volume;
      };
    } else if (channel.quantity == Quantity::Level) {
      sensor.read = [gauges, at, least](Model& model) {
        const auto stands = [&](const auto& x) { return stands_within(model, x, 1.5 * model.spacing()); };
        return gauges(model).level(at.x(), at.y(), stands).value_or(least);
      };
    } else if (channel.quantity == Quantity::Front) {
      sensor.read = [gauges, least](Model& model) { return gauges(model).front().value_or(least); };
    } else if (of_top) {
      const auto body = recording.find_body(channel.name.substr(kind.size() + 1));
      if (!body) {
        throw std::runtime_error(recording.name + ": measurements: " + channel.name + ": expected the name of a body");
      }
      for (double& value : values) {
        value *= 1e-3;  // the reader does not know its unit
      }
      sensor.from_first = kind == "top_mm";
      sensor.read = [gauges, id = static_cast<BodyId>(*body)](Model& model) {
        const auto& in = model.bodies()[id];
        return gauges(model).top(in.motion.at(model.time()), in.bounds).value_or(in.bounds.min().z());
      };
    } else {
      sensor.read = [gauges, at](Model& model) { return gauges(model).pressure(at); };
    }
    ReadingSeries series(sensor.name, sensor.error);
    for (std::size_t k = 0; k < times.size(); ++k) {
      const bool known = k > 0 || channel.quantity != Quantity::Pressure;  // a simulation has to make a step first
      series.add(times[k], known ? values[k] : std::numeric_limits<double>::quiet_NaN());
    }
    sensors.push_back(std::move(sensor));
    readings.push_back(std::move(series));
  }
  return {std::move(sensors), std::move(readings)};
}

}  // namespace example
