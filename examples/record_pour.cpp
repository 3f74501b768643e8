// SPDX-License-Identifier: MIT
// Records a pour that a reality other than the tracker's model makes:
//   record_pour --container cup --fill 0.6 --seed 1 --out DIR
// Exit status 0: done; 1: the run failed on the way; 2: an argument is wrong.

#include <cstdio>
#include <string>

#include <CLI/CLI.hpp>

#include <decant/io/progress.hpp>

#include "support/pour_twin.hpp"
#include "support/tool.hpp"

int main(int count, char** values) {
  example::PourTwin twin;
  std::string out;
  double spacing_mm = 1e3 * twin.spacing;
  double viscosity = 0, surface_tension = 0;
  bool plain = false, clean = false;
  CLI::App app("Records a pour from a cup or bottle over a pan, as a robot's camera would see it.");
  app.add_option("--out", out, "new folder for the recording")->required();
  app.add_option("--container", twin.container, "cup or bottle")->check(CLI::IsMember({"cup", "bottle"}));
  app.add_option("--fill", twin.fill_fraction, "share of the container that is full at first")
      ->check(CLI::Range(0.0, 1.0));
  app.add_option("--seed", twin.seed, "decides on motion, noise and hidden physics");
  app.add_option("--spacing-mm", spacing_mm, "of the reality's particles")->check(CLI::Range(1.0, 20.0));
  app.add_option("--seconds", twin.duration, "length of the recording")->check(CLI::Range(0.1, 60.0));
  auto* nothing = app.add_flag("--nothing-hidden", plain, "the reality has the model's own physics");
  auto* thickness =
      app.add_option("--viscosity", viscosity, "kinematic viscosity [m^2/s]; nothing else is hidden, but the tension")
          ->check(CLI::Range(0.0, 1e-2))
          ->excludes(nothing);
  auto* tension = app.add_option("--surface-tension", surface_tension,
                                 "[N/m]; nothing else is hidden, but the viscosity; the reality is position-based")
                      ->check(CLI::Range(0.0, 1.0))
                      ->excludes(nothing);
  app.add_flag("--clean", clean, "masks and poses without noise");
  try {
    app.parse(count, values);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  twin.spacing = 1e-3 * spacing_mm;
  twin.hidden_physics = !plain;
  twin.noisy_masks = twin.noisy_poses = !clean;
  if (!thickness->empty() || !tension->empty()) {
    example::HiddenPhysics& chosen = twin.chosen_physics.emplace();
    chosen.kinematic_viscosity = thickness->empty() ? chosen.kinematic_viscosity : viscosity;
    chosen.surface_tension = surface_tension;
  }
  return example::run_recorder([&] {
    decant::Progress progress("recording", 1);
    example::record_pour(twin, out, [&](double share) { progress.update(share); });
    progress.finish();
    std::printf("%s: %s, %.0f %% full; hidden: %s\n", out.c_str(), twin.container.c_str(), 100 * twin.fill_fraction,
                example::draw_hidden_physics(twin).words().c_str());
  });
}
