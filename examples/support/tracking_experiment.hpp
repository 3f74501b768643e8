// SPDX-License-Identifier: MIT
#pragma once

/// The tracking experiment of Schenck and Fox (2017) on twins of their pours: what goes wrong between a recording and
/// the tracker, and runs of methods.

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include <decant/core/image.hpp>
#include <decant/coverage/mask_cleaning.hpp>
#include <decant/force/linear_drag.hpp>
#include <decant/io/detail/text.hpp>
#include <decant/io/png.hpp>
#include <decant/io/recording_reader.hpp>
#include <decant/tracking/overlap.hpp>
#include <decant/tracking/overlap_score.hpp>
#include <decant/tracking/tracker.hpp>

#include "experiment_folder.hpp"
#include "pour_twin.hpp"
#include "pours.hpp"
#include "result_file.hpp"
#include "tracking_methods.hpp"
#include "tracking_run.hpp"

namespace example {

/// Reality is the model's own solver at another spacing, and bodies are where they are said to be: all that is wrong
/// is the masks' noise, from which a corrector can only do harm.
inline std::vector<Pour> harmless_pours() {
  std::vector<Pour> pours;
  std::uint32_t seed = 20;
  for (const char* container : {"cup", "bottle"}) {
    for (const int percent : {30, 60, 90}) {
      pours.push_back(pour("plain_", container, percent, ++seed));
      pours.back().twin.hidden_physics = pours.back().twin.noisy_poses = false;
    }
  }
  return pours;
}

inline std::vector<Pour> pours_named(const std::vector<std::string>& names) {
  std::vector<Pour> chosen = paper_pours();
  keep_pours(chosen, names);
  return chosen;
}

/// Something that goes wrong between a recording and the tracker, more or less.
struct Condition {
  using Apply = void (*)(double value, std::uint32_t seed, decant::Recording& recording, TrackingOptions& options);

  std::string name;  ///< for scripts and files
  std::string title;
  std::string label;           ///< of the value, with its unit
  std::vector<double> values;  ///< the first changes nothing
  bool in_masks;               ///< nothing but masks is altered: open loop does not notice
  Apply apply;
};

namespace detail {

/// Of a recording, a frame and a purpose, so that neither order nor number of frames plays a role.
inline std::mt19937 random_of(std::uint32_t seed, std::uint32_t purpose, std::size_t frame) {
  std::seed_seq sequence{seed, purpose, static_cast<std::uint32_t>(frame)};
  return std::mt19937(sequence);
}

/// Turns a share of the pixels that are (or are not) liquid over, each by itself.
inline decant::Mask with_wrong_pixels(decant::Mask mask, bool among_liquid, double share, std::mt19937& random) {
  const auto limit = static_cast<std::uint64_t>(share * 4294967296.0);  // of a generator's 32 bits
  for (decant::Index row = 0; row < mask.rows(); ++row) {
    for (decant::Index column = 0; column < mask.cols(); ++column) {
      if (const bool liquid = decant::is_liquid(mask(row, column)); liquid == among_liquid && random() < limit) {
        mask(row, column) = liquid ? std::uint8_t(0) : decant::mask_liquid;
      }
    }
  }
  return mask;
}

/// Grows liquid by a disc, or shrinks it if the radius is negative. What lies beyond the border has no say.
inline decant::Mask grown(const decant::Mask& mask, int radius_px) {
  const bool spreading = radius_px > 0;  // what spreads: liquid, or its absence
  const decant::Index reach = std::abs(radius_px);
  decant::Mask out = mask;
  for (decant::Index row = 0; row < mask.rows(); ++row) {
    for (decant::Index column = 0; column < mask.cols(); ++column) {
      if (decant::is_liquid(mask(row, column)) != spreading) {
        continue;
      }
      for (decant::Index v = std::max<decant::Index>(0, row - reach); v <= std::min(mask.rows() - 1, row + reach);
           ++v) {
        for (decant::Index u = std::max<decant::Index>(0, column - reach);
             u <= std::min(mask.cols() - 1, column + reach); ++u) {
          if ((v - row) * (v - row) + (u - column) * (u - column) <= reach * reach) {
            out(v, u) = spreading ? decant::mask_liquid : std::uint8_t(0);
          }
        }
      }
    }
  }
  return out;
}

inline decant::Mask cleaned(const decant::Mask& mask) {
  const decant::TrackerSettings settings;
  decant::Mask out(mask.rows(), mask.cols());
  decant::MaskCleaning(settings.cleaning_window_px, settings.smallest_region_px).apply(mask, out, {1});
  return out;
}

/// Puts the source container elsewhere, always in the same direction.
inline void misplace(double millimetres, double degrees, std::uint32_t seed, decant::Recording& recording) {
  for (decant::recording::Body& body : recording.bodies) {
    if (body.role != decant::recording::Role::Source) {
      continue;
    }
    std::vector<decant::PoseTrack::Sample> samples;
    for (const auto& sample : body.motion.samples()) {
      std::mt19937 random = random_of(seed, 1, 0);
      samples.push_back({sample.time, off_by(sample.pose, millimetres, degrees, random)});
    }
    body.motion = decant::PoseTrack(std::move(samples));
  }
}

inline void flip_pixels(bool among_liquid, double percent, std::uint32_t seed, TrackingOptions& options) {
  options.masks = [=](const decant::Recording& recording, std::size_t frame, std::size_t camera) {
    std::optional<decant::Mask> mask = recording.mask(frame, camera);
    if (mask) {
      std::mt19937 random = random_of(seed, among_liquid ? 2 : 3, frame);
      mask = with_wrong_pixels(std::move(*mask), among_liquid, 0.01 * percent, random);
    }
    return mask;
  };
}

/// Cleaned first: it is liquid that a segmentation draws too fat or too thin, and not the specks of its noise, which
/// grown by some pixels would cover the picture.
inline void grow_masks(int radius_px, TrackingOptions& options) {
  options.masks = [=](const decant::Recording& recording, std::size_t frame, std::size_t camera) {
    std::optional<decant::Mask> mask = recording.mask(frame, camera);
    return mask ? std::optional<decant::Mask>(grown(cleaned(*mask), radius_px)) : std::nullopt;
  };
}

}  // namespace detail

/// From little to much, each from where nothing is altered.
inline const std::vector<Condition>& sweep_conditions() {
  using decant::Recording;
  static const std::vector<Condition> all{
      {"pose_mm",
       "The container is not where it is said to be",
       "off by [mm]",
       {0, 2, 5, 10},
       false,
       [](double value, std::uint32_t seed, Recording& recording, TrackingOptions&) {
         detail::misplace(value, 0, seed, recording);
       }},
      {"pose_deg",
       "The container is not turned as it is said to be",
       "off by [degrees]",
       {0, 1, 2.5, 5},
       false,
       [](double value, std::uint32_t seed, Recording& recording, TrackingOptions&) {
         detail::misplace(0, value, seed, recording);
       }},
      {"false_positives",
       "Pixels of the background are taken for liquid",
       "of the background [%]",
       {0, 5, 10, 20},
       true,
       [](double value, std::uint32_t seed, Recording&, TrackingOptions& options) {
         detail::flip_pixels(false, value, seed, options);
       }},
      {"false_negatives",
       "Pixels of the liquid are taken for background",
       "of the liquid [%]",
       {0, 5, 10, 20},
       true,
       [](double value, std::uint32_t seed, Recording&, TrackingOptions& options) {
         detail::flip_pixels(true, value, seed, options);
       }},
      {"dropped",
       "Frames without a mask",
       "dropped [%]",
       {0, 20, 40, 60, 80},
       true,
       [](double value, std::uint32_t seed, Recording&, TrackingOptions& options) {
         options.masks = [=](const Recording& recording, std::size_t frame, std::size_t camera) {
           // the same numbers for every value: what is dropped at 20 % is dropped at 40 %, too
           std::mt19937 random = detail::random_of(seed, 4, frame);
           const bool dropped = std::uniform_real_distribution<double>(0, 100)(random) < value;
           return dropped ? std::nullopt : recording.mask(frame, camera);
         };
       }},
      {"late",
       "Masks come late, poses do not",
       "late by [frames]",
       {0, 1, 2, 4},
       true,
       [](double value, std::uint32_t, Recording&, TrackingOptions& options) {
         options.masks = [late = static_cast<std::size_t>(value)](const Recording& recording, std::size_t frame,
                                                                  std::size_t camera) {
           return frame < late ? std::nullopt : recording.mask(frame - late, camera);
         };
       }},
      {"fat",
       "Masks are too fat",
       "too fat by [px]",
       {0, 1, 2, 3},
       true,
       [](double value, std::uint32_t, Recording&, TrackingOptions& options) {
         detail::grow_masks(static_cast<int>(value), options);
       }},
      {"thin",
       "Masks are too thin",
       "too thin by [px]",
       {0, 1, 2, 3},
       true,
       [](double value, std::uint32_t, Recording&, TrackingOptions& options) {
         detail::grow_masks(-static_cast<int>(value), options);
       }},
  };
  return all;
}

/// How much liquid the model is told there is, over what there is.
inline const Condition& amount_condition() {
  static const Condition condition{"amount",
                                   "The model is told a wrong amount",
                                   "told over true",
                                   {1, 0.7, 1.3},
                                   false,
                                   [](double value, std::uint32_t, decant::Recording&, TrackingOptions& options) {
                                     options.initial_amount_factor = value;
                                   }};
  return condition;
}

/// One method on one recording under one condition.
struct TrackingJob {
  Pour pour;
  std::string method;  ///< or perfect_state, true_effects
  const Condition* condition = nullptr;
  double value = 0;

  /// For files and results. A condition's first value is the recording as it is.
  std::string key() const {
    return pour.name + "." + method +
           (altered() ? "." + condition->name + "_" + decant::detail::number_text(value) : "");
  }
  bool altered() const { return condition != nullptr && value != condition->values.front(); }
};

/// The name of a method that is none: a state whose silhouette is the true one. Its score is what the masks' noise
/// alone takes away.
inline const std::string perfect_state = "perfect_state";

/// Another one: open loop, by a model that has been told the physics that it lacks, and how late poses are. What
/// knowing the cause gives, without looking at a single mask; solver, spacing and noisy poses are the model's own.
inline const std::string true_effects = "true_effects";

struct ExperimentOptions {
  std::filesystem::path folder;                      ///< of the recordings, with results/ in it
  double model_spacing = TrackingOptions{}.spacing;  ///< [m]
  double reality_spacing = PourTwin{}.spacing;       ///< [m]
  double duration = PourTwin{}.duration;             ///< of each recording [s]
  int threads = 0;                                   ///< how many jobs run side by side; 0: one per core
  bool again = false;                                ///< computes what is there already anew
};

/// Makes recordings and runs methods on them, or finds both in its folder.
class TrackingExperiment {
 public:
  /// Throws std::runtime_error where the folder cannot be written to.
  explicit TrackingExperiment(ExperimentOptions options)
      : options_(std::move(options)), folder_(options_.folder, options_.threads, options_.again) {}

  /// Runs what is not there yet; afterwards all have a result(). See ExperimentFolder::run.
  void run(const std::vector<TrackingJob>& jobs) {
    std::vector<ExperimentJob> all;
    for (const TrackingJob& job : jobs) {
      all.push_back({job.key(),
                     settings_json(job),
                     {recording_of(job.pour, options_.reality_spacing, options_.duration)},
                     [this, job](const auto& progress) { return compute(job, progress); }});
    }
    folder_.run("tracking", all);
  }

  /// Of a job that was run; other keys are an std::out_of_range.
  const nlohmann::json& result(const TrackingJob& job) const { return folder_.result(job.key()); }
  const std::map<std::string, nlohmann::json>& results() const { return folder_.results(); }
  std::size_t recorded() const { return folder_.recorded(); }  ///< recordings that were made
  std::size_t computed() const { return folder_.computed(); }  ///< results that were computed, of those asked() for
  std::size_t asked() const { return folder_.asked(); }

 private:
  // Forecasts double the time; of altered recordings nobody asks for them.
  std::vector<double> forecasts(const TrackingJob& job) const {
    return job.altered() || job.method == perfect_state ? std::vector<double>() : std::vector<double>{0.25, 0.5, 1};
  }

  // What a result depends on, beside the program.
  nlohmann::json settings_json(const TrackingJob& job) const {
    nlohmann::json json;
    json["job"] = job.key();
    json["model_spacing_mm"] = 1e3 * options_.model_spacing;
    json["reality_spacing_mm"] = 1e3 * options_.reality_spacing;
    json["duration_s"] = options_.duration;
    json["forecasts_s"] = forecasts(job);
    return json;
  }

  struct SharedModel {
    std::mutex guard;
    std::optional<TrackingModel> model;
  };

  // Filling a container takes as long as tracking a second or two; jobs that start alike share it.
  TrackingModel filled_model(const TrackingJob& job, const decant::Recording& recording,
                             const TrackingOptions& options) {
    const bool starts_as_recorded = !job.altered() || job.condition->in_masks;
    std::shared_ptr<SharedModel> shared;
    {
      const std::lock_guard lock(models_guard_);
      auto& entry =
          models_[starts_as_recorded ? job.pour.name : TrackingJob{job.pour, "", job.condition, job.value}.key()];
      if (!entry) {
        entry = std::make_shared<SharedModel>();
      }
      shared = entry;
    }
    const std::lock_guard lock(shared->guard);
    if (!shared->model) {
      shared->model.emplace(model_of<TrackingParts>(recording, options));
    }
    return *shared->model;
  }

  /// For true_effects: the model, and the recording without what its poses are late by.
  static TrackingModel model_told(const nlohmann::json& truth, decant::Recording& recording, TrackingOptions& options) {
    for (decant::Index axis = 0; axis < 3; ++axis) {
      recording.gravity[axis] += truth.at("pull_m_s2").at(static_cast<std::size_t>(axis)).get<double>();
    }
    recording.liquid.viscosity = recording.liquid.density * truth.at("kinematic_viscosity_m2_s").get<double>();
    for (decant::recording::Body& body : recording.bodies) {
      std::vector<decant::PoseTrack::Sample> samples = body.motion.samples();
      for (auto& sample : samples) {
        sample.time -= truth.at("latency_s").get<double>();
      }
      body.motion = decant::PoseTrack(std::move(samples));
    }
    options.source_slip = truth.at("sticky_walls").get<bool>() ? decant::Slip::None : decant::Slip::Free;
    TrackingModel model = model_of<TrackingParts>(recording, options);
    model.force<decant::LinearDrag<float>>().rate = truth.at("drag_1_s").get<float>();
    return model;
  }

  nlohmann::json compute(const TrackingJob& job, const std::function<void(double)>& progress) {
    const std::filesystem::path folder = folder_.recording(job.pour.name), truth_masks = folder / "truth_mask";
    const nlohmann::json truth = folder_.truth(job.pour.name);
    decant::Recording recording = decant::read_recording(folder);
    const auto frames = static_cast<double>(recording.frames);
    const auto progressed = [&](std::size_t done) { progress(static_cast<double>(done) / frames); };
    if (job.method == perfect_state) {
      return score_perfect_state(recording, truth_masks, progressed);
    }
    TrackingOptions options;
    options.spacing = options_.model_spacing;
    options.forecasts = forecasts(job);
    options.threads = 1;
    if (job.altered()) {
      job.condition->apply(job.value, job.pour.twin.seed, recording, options);
    }
    const bool told = job.method == true_effects;
    const TrackingModel model = told ? model_told(truth, recording, options) : filled_model(job, recording, options);
    const TrackingResult result =
        tracking_method(told ? "open_loop" : job.method)(recording, model, options, truth_masks, progressed);
    nlohmann::json json = tracking_json(result, recording, options.forecasts);
    json["pixels"] = pixels_json(result.posterior);
    json["truth_iou_mean"] = number_json(result.against_truth.mean_over_frames());
    json["truth_iou_pooled"] = number_json(result.against_truth.pooled_over_pixels());
    json["truth_prior_iou"] = number_json(result.prior_against_truth.mean_over_frames());
    json["truth_pixels"] = pixels_json(result.against_truth);
    json["true_initial_ml"] = truth.at("initial_ml");
    for (const auto& [body, volumes] : truth.at("volume_ml").items()) {
      json["true_volume_ml"][body] = volumes;
    }
    return json;
  }

  static nlohmann::json pixels_json(const decant::OverlapScore& score) {
    return {{"both", score.pixels().both_px}, {"union", score.pixels().union_px()}};
  }

  static nlohmann::json score_perfect_state(const decant::Recording& recording,
                                            const std::filesystem::path& truth_masks,
                                            const std::function<void(std::size_t)>& progress) {
    decant::OverlapScore score;
    for (std::size_t frame = 0; frame < recording.frames; ++frame) {
      if (const std::optional<decant::Mask> mask = recording.mask(frame)) {
        const decant::Mask truth = decant::read_png_grey8(truth_masks / (decant::detail::six_digits(frame) + ".png"));
        score.add(decant::overlap(truth, detail::cleaned(*mask)));
      }
      progress(frame + 1);
    }
    nlohmann::json json;
    json["iou_mean"] = json["prior_iou"] = number_json(score.mean_over_frames());
    json["iou_pooled"] = number_json(score.pooled_over_pixels());
    json["pixels"] = pixels_json(score);
    json["status"] = "ok";
    return json;
  }

  ExperimentOptions options_;
  ExperimentFolder folder_;
  std::mutex models_guard_;
  std::map<std::string, std::shared_ptr<SharedModel>> models_;
};

}  // namespace example
