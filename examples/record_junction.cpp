// SPDX-License-Identifier: MIT
// Records a litre that runs through a pipe junction, of which a leg may be blocked:
//   record_junction --left 0.4 --seed 1 --out DIR
// Exit status 0: done; 1: the run failed on the way; 2: an argument is wrong.

#include <cstdio>
#include <string>

#include <CLI/CLI.hpp>

#include <decant/io/progress.hpp>

#include "support/junction_twin.hpp"
#include "support/tool.hpp"

int main(int count, char** values) {
  example::JunctionTwin twin;
  std::string out;
  double spacing_mm = 1e3 * twin.spacing;
  bool plain = false, clean = false;
  CLI::App app("Records water that runs through a pipe junction into two bowls, as a robot's camera would see it.");
  app.failure_message([](const CLI::App*, const CLI::Error& error) { return std::string(error.what()) + "\n"; });
  app.add_option("--out", out, "new folder for the recording")->required();
  app.add_option("--left", twin.left_opening, "share of the left leg's cross-section that is open")
      ->check(CLI::Range(0.0, 1.0));
  app.add_option("--right", twin.right_opening, "the same of the right leg")->check(CLI::Range(0.0, 1.0));
  app.add_option("--leak", twin.leak, "a hole in the left leg's underside, as a share of its cross-section")
      ->check(CLI::Range(0.0, 0.5));
  app.add_option("--seed", twin.seed, "decides on noise, hidden physics and where in the leg it is blocked");
  app.add_option("--spacing-mm", spacing_mm, "of the reality's particles")->check(CLI::Range(1.0, 20.0));
  app.add_option("--seconds", twin.duration, "length of the recording")->check(CLI::Range(0.1, 60.0));
  app.add_flag("--nothing-hidden", plain, "the reality has the model's own physics");
  app.add_flag("--clean", clean, "masks and poses without noise");
  try {
    app.parse(count, values);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  twin.spacing = 1e-3 * spacing_mm;
  twin.hidden_physics = !plain;
  twin.noisy_masks = twin.noisy_poses = !clean;
  return example::run_recorder([&] {
    decant::Progress progress("recording", 1);
    example::record_junction(twin, out, [&](double share) { progress.update(share); });
    progress.finish();
    std::printf("%s: left leg %.0f %% open, right leg %.0f %%%s; hidden: %s\n", out.c_str(), 100 * twin.left_opening,
                100 * twin.right_opening, twin.leak > 0 ? ", a leak" : "",
                example::draw_junction_errors(twin).physics.words().c_str());
  });
}
