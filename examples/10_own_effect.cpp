// SPDX-License-Identifier: MIT
// What does the model lack? A cup is poured into a pan on a turntable, of which the catalogue knows nothing: there is a
// gap that nothing explains. With the turntable as an effect of one's own, a force with a name, a unit and a range, it
// is found, with its strength.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>
#include <vector>

#include <decant/decant.hpp>
#include <decant/discovery/liquid_effects.hpp>
#include <decant/discovery/missing_effect.hpp>
#include <decant/discovery/simulated_interaction.hpp>

using namespace decant;

/// Drags liquid on the floor around with the table: a = 8/s (speed of the table - v) for what is below 12 mm.
struct Turntable {
  using Scalar = float;
  float turns = 0;  // [rad/s]

  template <class Step>
  void accumulate(const Step& step, PointArray<float>& acceleration) noexcept {
    for (Index i = 0; turns != 0 && i < step.fluid.size(); ++i) {
      const Vector3<float> x = step.fluid.position.col(i), table = turns * Vector3<float>(-x.y(), x.x(), 0);
      if (x.z() < 0.012F)
        acceleration.col(i) += 8 * (table - step.fluid.velocity.col(i));
    }
  }
  template <class Step>
  float largest_step(const Step&) const noexcept {
    return 0.01F;
  }
};

using Model = Simulator<WithForces<EffectParts<>, Turntable>>;
using Pour = SimulatedInteraction<Model, PinholeCamera>;

/// A small cup that turns over a pan within half a second, seen from above.
Pour::Scene small_pour() {
  Pour::Scene scene;
  std::vector<PoseTrack::Sample> poses;
  for (int k = 0; k <= 40; ++k) {
    const double time = 0.025 * k, turn = 1.9 * std::min(time / 0.4, 1.0);
    const Eigen::Quaterniond tilted(Eigen::AngleAxisd(turn, Eigen::Vector3d::UnitY()));
    poses.push_back({time, Pose{tilted, Vector3<double>(-0.06, 0.03, 0.11)}});
  }
  scene.motion = {PoseTrack(poses), PoseTrack()};
  scene.start = [cup_motion = scene.motion[0]](SimulatorSettings settings, double fill_factor) {
    settings.threads = {1};
    settings.liquid.surface_tension = 0;
    Model model(settings);
    const BodyId cup = model.add_body("cup", Cup{0.025, 0.03, 0.07, 0.003}, PoseTrack(cup_motion.at(0)));
    model.add_body("pan", CylinderInside{0.08, 0.03, 0.003, Face::PositiveZ});
    fill(model, cup, FillAmount::fraction(0.6 * fill_factor));
    return model;
  };
  for (double time = 0; time < 1; time += 0.1)
    scene.times.push_back(time);
  const Eigen::Quaterniond down(Eigen::AngleAxisd(3.14159265, Eigen::Vector3d::UnitX()));
  const std::vector<Pose> above(scene.times.size(), Pose{down, {0, 0, 0.5}});
  scene.cameras.push_back({PinholeCamera(500, 500, 159.5, 119.5, 320, 240), above, 500, 0.5});
  return scene;
}

int main() {
  SimulatedInteractionSettings settings;
  settings.spacing = 0.0085;
  std::vector<InteractionEffect<Model>> catalogue = force_effects<Model>(1e-6), longer = catalogue;
  Effect turntable;
  turntable.name = "turntable";
  turntable.unit = "rad/s";
  turntable.components = {{"", 0, -12, 12}};
  longer.push_back(force_effect<Turntable, Model>(
      turntable, [](Turntable& force, double s) { force.turns = static_cast<float>(s); }));
  const Pour known(small_pour(), catalogue, settings), extended(small_pour(), longer, settings);

  settings.spacing = 0.0078;  // what is recorded has other particles
  const double really = 7;
  const Pour reality(small_pour(), longer, settings);
  const auto recording = reality.predict({{{longer.size() - 1, Eigen::VectorXd::Constant(1, really)}}, 4711});
  ThreadExecutor executor;
  MissingEffectSettings quick;
  quick.dictionary.draws = 20;
  const auto search = [&](const Pour& pour) {
    return MissingEffectSearch<Pour>({{"pour", &pour, recording}}, {}, run_jobs_on(executor), quick).find();
  };
  const MissingEffect before = search(known), after = search(extended);
  const bool unexplained = before.verdict == Verdict::Unexplained;
  const bool named = after.verdict == Verdict::Named && extended.effects()[after.found[0].effect].name == "turntable";
  std::printf("without it: %s; with it: %s\n", unexplained ? "unexplained" : "something",
              named ? "the turntable" : "something else");
  if (!unexplained || !named)
    return 1;
  const auto [low, high] = after.found[0].interval_90(0);
  std::printf("it turns by %.2f rad/s (90 %% within %.2f .. %.2f), really by %.0f\n", after.found[0].strength[0], low,
              high, really);
  return std::abs(after.found[0].strength[0] - really) < 0.2 * really ? 0 : 1;
}
