// SPDX-License-Identifier: MIT
// Which viscosity (and surface tension) a liquid has, by recordings of how it was poured:
//   fit_liquid --learn DIR... --held-out DIR... --parameters viscosity --json OUT.json --report OUT.html
//   mpirun -n 8 fit_liquid_mpi --learn DIR...      the same on many machines, where MPI is installed
// Exit status 0: done; 1: no run could be followed to its end; 2: a recording, a file or an argument is wrong.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <decant/core/stopwatch.hpp>
#include <decant/io/detail/text.hpp>
#include <decant/io/journal.hpp>
#include <decant/io/progress.hpp>
#include <decant/io/recording_reader.hpp>
#include <decant/io/report.hpp>
#include <decant/io/table.hpp>
#include <decant/version.hpp>

#include "support/liquid_fit.hpp"
#include "support/result_file.hpp"
#include "support/sweep_executor.hpp"
#include "support/tool.hpp"

namespace {

using decant::detail::fixed_text;
using decant::detail::number_text;

decant::Table parameters_table(const example::LiquidFit& fit) {
  decant::Table table({"parameter", "search", "evaluations", "best run", "value", "from", "to", "told"});
  for (const example::LiquidSearch& search : fit.searches) {
    for (std::size_t axis = 0; axis < search.parameters.size(); ++axis) {
      const auto& of = search.parameters[axis];
      table.add({fit.axes[axis].name + " [" + fit.axes[axis].unit + "]", search.name,
                 std::to_string(search.evaluations.size()),
                 example::three_digits(search.evaluations[search.best].point[axis]), example::three_digits(of.value),
                 example::three_digits(of.low), example::three_digits(of.high), of.told() ? "yes" : "no"});
    }
  }
  return table;
}

decant::Table gain_table(const example::LiquidFit& fit) {
  decant::Table table({"recording", "learnt from", "IoU, assumed [%]", "IoU, fitted [%]"});
  const auto add = [&](const example::LiquidGain& gain, const char* learnt) {
    for (std::size_t k = 0; k < gain.before.size(); ++k) {
      table.add({gain.recordings[k], learnt, fixed_text(100 * gain.before[k].iou, 1),
                 fixed_text(100 * gain.after[k].iou, 1)});
    }
  };
  add(fit.learn, "yes");
  add(fit.held_out, "no");
  return table;
}

void write_report(const std::string& file, const example::LiquidFit& fit) {
  decant::HtmlReport report("Which liquid it was");
  for (std::size_t axis = 0; axis < fit.search().parameters.size(); ++axis) {
    report.paragraph(example::sentence(fit.axes[axis], fit.search().parameters[axis]) + ".");
  }
  report.heading("Parameters");
  report.table(parameters_table(fit));
  for (std::size_t axis = 0; axis < fit.search().parameters.size(); ++axis) {
    const decant::ParameterAxis& of = fit.axes[axis];
    const bool decades = of.scale == decant::AxisScale::Logarithmic;
    const auto place = [&](double value) { return decades ? std::log10(value) : value; };
    const std::string label = decades ? "log10 of " + of.name + " in " + of.unit : of.name + " [" + of.unit + "]";
    decant::LineChart density{"What is known of " + of.name, label, "density by share of the range", {}, {}, {0}};
    decant::LineChart misfits{"Misfit by " + of.name, label, "sum of squared differences of cells", {}, {}, {}};
    for (const example::LiquidSearch& search : fit.searches) {
      decant::LineChart::Line known{search.name, {}, {}}, runs{search.name, {}, {}};
      for (std::size_t k = 0; k < search.parameters[axis].share.size(); ++k) {
        known.x.push_back(place(of.at(search.parameters[axis].share[k])));
        known.y.push_back(search.parameters[axis].density[k]);
      }
      std::vector<std::pair<double, double>> sorted;
      for (const decant::Evaluation& one : search.evaluations) {
        sorted.emplace_back(place(one.point[axis]), one.misfit());
      }
      std::sort(sorted.begin(), sorted.end());
      for (const auto& [x, y] : sorted) {
        runs.x.push_back(x);
        runs.y.push_back(y);
      }
      density.lines.push_back(std::move(known));
      misfits.lines.push_back(std::move(runs));
    }
    report.chart(density);
    report.chart(misfits);
  }
  report.heading("Before and after");
  report.paragraph(
      "Intersection over union of what is predicted open loop, with the liquid that the recordings name and "
      "with the fitted one.");
  report.table(gain_table(fit));
  report.write(file);
}

}  // namespace

int main(int count, char** values) {
  const example::SweepSession session;
  std::string json_file, report_file, journal_file, method = "surrogate";
  std::vector<std::string> learn_folders, held_out_folders;
  example::LiquidFitOptions options;
  example::TrackingOptions tracking;
  double spacing_mm = 5;
  int threads = 0;
  CLI::App app("Fits a liquid's viscosity and surface tension to recordings of pours.");
  app.add_option("--learn", learn_folders, "folders of recordings to fit to, format version 1")->required();
  app.add_option("--held-out", held_out_folders, "folders of other recordings, to score the fit on");
  app.add_option("--parameters", options.parameters, "viscosity, surface_tension; several by commas")
      ->delimiter(',')
      ->check(CLI::IsMember({"viscosity", "surface_tension"}));
  app.add_option("--method", method,
                 "best_first: the paper's search on a grid; surrogate: asks where the answer depends on it; both: the "
                 "latter's fit counts")
      ->check(CLI::IsMember({"best_first", "surrogate", "both"}));
  app.add_option("--most-evaluations", options.most_evaluations,
                 "of each search; each runs all recordings to learn from")
      ->check(CLI::Range(9, 10000));
  app.add_option("--journal", journal_file,
                 "keeps the result of each run, so that a fit that was stopped goes on where it was");
  app.add_option("--json", json_file, "writes parameters, evaluations and scores");
  app.add_option("--report", report_file, "writes a page with tables and charts, for a browser");
  app.add_option("--spacing-mm", spacing_mm, "of the model's particles")->check(CLI::Range(1.0, 20.0));
  app.add_option("--threads", threads,
                 "runs side by side, each on one thread, by MPI in each process; 0: one per core, by MPI one")
      ->check(CLI::Range(0, 1024));
  return example::run_tool(app, count, values, [&] {
    options.best_first = method != "surrogate";
    options.surrogate = method != "best_first";
    example::SweepExecutor executor = example::sweep_executor(threads);
    example::in_first_process(executor, [&] { example::expect_writable({json_file, report_file}); });
    example::expect_apart(learn_folders, held_out_folders);
    const std::vector<decant::ParameterAxis> axes = example::axes_of(options.parameters);
    tracking.spacing = 1e-3 * spacing_mm;
    tracking.threads = 1;
    const auto read = [&](const std::vector<std::string>& folders) {
      std::vector<example::LiquidRecording> recordings;
      for (const std::string& folder : folders) {
        recordings.emplace_back(decant::read_recording(folder), tracking);
      }
      return recordings;
    };
    const double searches = method == "both" ? 2 : 1;
    const double at_most = searches * options.most_evaluations * static_cast<double>(learn_folders.size()) +
                           2 * static_cast<double>(learn_folders.size() + held_out_folders.size());
    decant::Progress progress("fitting", at_most);
    double runs = 0, milliseconds = 0;
    const auto told = [&] {
      ++runs;
      progress.update(runs, number_text(runs) + " runs, at most " + number_text(at_most));
    };
    std::optional<decant::Journal> journal;
    if (!journal_file.empty()) {
      journal.emplace(executor, journal_file, std::string("fit_liquid of decant ") + DECANT_VERSION);
    }
    decant::Journal* kept = journal ? &*journal : nullptr;
    example::LiquidFit fit;
    {
      const decant::Stopwatch watch(milliseconds);
      example::LiquidRuns learn(read(learn_folders), axes, executor, kept, told);
      example::LiquidRuns held_out(read(held_out_folders), axes, executor, kept, told);
      fit = example::fit_liquid(learn, held_out, options);
    }
    progress.finish();
    for (std::size_t axis = 0; axis < fit.search().parameters.size(); ++axis) {
      std::printf("%s\n", example::sentence(fit.axes[axis], fit.search().parameters[axis]).c_str());
    }
    std::printf("%s%s", parameters_table(fit).text().c_str(), gain_table(fit).text().c_str());
    example::in_first_process(executor, [&] {
      if (!json_file.empty()) {
        nlohmann::json json = example::liquid_fit_json(fit);
        json["seconds"] = 1e-3 * milliseconds;
        json["spacing_mm"] = spacing_mm;
        example::write_result(json_file, json);
      }
      if (!report_file.empty()) {
        write_report(report_file, fit);
      }
    });
    return fit.works() ? 0 : 1;
  });
}
