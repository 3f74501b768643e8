// SPDX-License-Identifier: MIT
// Records two pours, DIR/a and DIR/b, in which one effect may be hidden that a liquid's model lacks:
//   record_effect --range develop --kind moderate --case 3 --out DIR
//   record_effect --scenario 2 --nothing --seed 7 --out DIR      for reference: nothing is hidden
//   record_effect --range report --kind weak --list              which cases there are, not what is hidden in them
// Exit status 0: done; 1: the run failed on the way; 2: an argument is wrong.

#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <string>

#include <CLI/CLI.hpp>

#include <decant/io/progress.hpp>

#include "support/effect_recording.hpp"
#include "support/tool.hpp"

int main(int count, char** values) {
  using example::CaseKind;
  using example::CaseRange;
  std::string out, pours = "both";
  CaseRange range = CaseRange::Develop;
  CaseKind kind = CaseKind::Moderate;
  int number = 0;
  std::size_t scenario = 0;
  std::uint32_t seed = 1;
  bool list = false, plain = false, without = false;
  example::EffectRecordingSettings settings;
  double spacing_mm = 1e3 * settings.spacing;
  CLI::App app("Records a pour to learn from and another to predict, with one effect hidden in both.");
  app.failure_message([](const CLI::App*, const CLI::Error& error) { return std::string(error.what()) + "\n"; });
  app.add_option("--out", out, "new folder for the recordings a and b");
  app.add_option("--range", range, "develop: to choose a method by; report: to say how good it is")
      ->transform(CLI::CheckedTransformer(example::case_ranges()));
  app.add_option(
         "--kind", kind,
         "moderate, weak, two (effects at once), nothing, outside (what no method is told of), measurement, cylinder "
         "(one that a robot moves), cylinder_two or junction")
      ->transform(CLI::CheckedTransformer(example::case_kinds()));
  auto* numbered = app.add_option("--case", number, "number of the case, from 0 on")->check(CLI::Range(0, 1000000));
  app.add_flag("--list", list, "names the cases of a kind and their scenarios, and records nothing");
  auto* nothing = app.add_flag("--nothing", plain, "a reference: nothing is hidden");
  app.add_option("--scenario", scenario, "of a reference")
      ->check(CLI::Range(std::size_t{0}, example::effect_scenarios().size() - 1))
      ->needs(nothing);
  app.add_option("--seed", seed, "of a reference: tolerated errors and noise")->needs(nothing);
  nothing->excludes(numbered);
  app.add_option("--pour", pours, "a, b or both, or one of c, d, e, f: what may be recorded next")
      ->check(CLI::IsMember({"a", "b", "c", "d", "e", "f", "both"}));
  app.add_flag("--without-effect", without, "the same errors and noise, but nothing is hidden");
  app.add_flag("--truth-masks", settings.truth_masks, "writes clean silhouettes, too");
  app.add_flag("--scale", settings.scale, "weighs what is in the pan, too");
  app.add_option("--solver", settings.solver, "of the reality: divergence_free, as models have it, or position_based")
      ->transform(CLI::CheckedTransformer(example::reality_solvers()));
  app.add_option("--spacing-mm", spacing_mm, "of the reality's particles")->check(CLI::Range(1.0, 20.0));
  app.add_option("--frames-per-second", settings.frames_per_second)->check(CLI::Range(1.0, 240.0));
  app.add_option("--seconds", settings.longest, "cuts pours off there")->check(CLI::Range(0.1, 60.0));
  try {
    app.parse(count, values);
    if (!list && out.empty()) {
      throw CLI::RequiredError("--out");
    }
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  settings.spacing = 1e-3 * spacing_mm;
  settings.with_effect = !without;
  return example::run_recorder([&] {
    if (list) {
      for (int k = 0; k < example::usual_cases(range, kind); ++k) {
        const example::EffectCase each = example::effect_case(range, kind, k);
        std::printf("%s %s %d: scenario %zu\n", each.range.c_str(), each.kind.c_str(), k, each.scenario);
      }
      return;
    }
    const example::EffectCase hidden =
        plain ? example::reference_case(scenario, seed) : example::effect_case(range, kind, number);
    decant::Progress progress("recording", pours == "both" ? 2 : 1);
    double done = 0;
    for (std::size_t which = 0; which < 2 + example::further_interactions; ++which) {
      const std::string pour = example::interaction_letter(which);
      if (pours == pour || (pours == "both" && which < 2)) {
        example::record_case(hidden, which, std::filesystem::path(out) / pour, settings,
                             [&](double share) { progress.update(done + share); });
        ++done;
      }
    }
    progress.finish();
    std::printf("%s: scenario %zu\n", out.c_str(), hidden.scenario);
  });
}
