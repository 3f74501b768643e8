// SPDX-License-Identifier: MIT
// Runs any scene file: simulate SCENE.json --json OUT.json [--vtk DIR] [--report OUT.html] [--threads N]
// Exit status 0: done; 1: the run failed on the way (the series so far is kept); 2: the scene or an argument is wrong.

#include <algorithm>
#include <cstddef>
#include <cstdio>
#include <exception>
#include <string>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>

#include <decant/core/parallel.hpp>
#include <decant/io/report.hpp>
#include <decant/io/scene.hpp>
#include <decant/io/table.hpp>

#include "support/compositions.hpp"
#include "support/result_file.hpp"
#include "support/scene_run.hpp"

namespace {

std::string number(double value, int digits) { return decant::detail::fixed_text(value, digits); }

decant::Table summary(const example::RunResult& result) {
  decant::Table table({"", "value"});
  table.add({"status", result.status});
  table.add({"particles", std::to_string(result.particles)});
  table.add({"volume [ml]", number(1e6 * result.volume, 1)});
  table.add({"lost through walls", std::to_string(result.lost)});
  table.add({"outside of containers", std::to_string(result.spilled)});
  table.add({"sub-steps", std::to_string(result.sub_steps)});
  table.add({"iterations per sub-step",
             number(static_cast<double>(result.iterations) / static_cast<double>(std::max(1L, result.sub_steps)), 1)});
  table.add({"largest density error [%]", number(100 * result.density_error_max, 3)});
  table.add({"set-up [s]", number(result.set_up_seconds, 1)});
  table.add({"steps [s]", number(result.step_seconds, 1)});
  return table;
}

// What a gauge's name says before its place, as a title with unit.
std::string title_of(const std::string& kind) {
  const std::vector<std::pair<std::string, std::string>> titles = {
      {"level_mm", "level [mm]"},
      {"front_mm", "front [mm]"},
      {"pressure_pa", "pressure [Pa]"},
      {"volume_ml", "volume [ml]"},
      {"top_mm", "highest point above the first level [mm]"},
      {"force_n_x", "force x [N]"},
      {"force_n_y", "force y [N]"},
      {"force_n_z", "force z [N]"}};
  for (const auto& [name, title] : titles) {
    if (name == kind) {
      return title;
    }
  }
  return kind;
}

void write_report(const std::string& path, const decant::Scene& scene, const example::RunResult& result) {
  decant::HtmlReport report(scene.name);
  report.table(summary(result));
  report.film(result.pictures, "The liquid; lighter where it is faster.");
  // gauges of one quantity share a chart
  std::vector<std::string> kinds;
  for (std::size_t k = 1; k < result.series.names.size(); ++k) {
    const std::string kind = result.series.names[k].substr(0, result.series.names[k].find('@'));
    if (std::find(kinds.begin(), kinds.end(), kind) == kinds.end()) {
      kinds.push_back(kind);
    }
  }
  for (const std::string& kind : kinds) {
    decant::LineChart chart{title_of(kind), "time [s]", title_of(kind), {}};
    for (std::size_t k = 1; k < result.series.names.size(); ++k) {
      if (result.series.names[k].substr(0, result.series.names[k].find('@')) == kind) {
        chart.lines.push_back({result.series.names[k], result.series.columns[0], result.series.columns[k], false});
      }
    }
    report.chart(chart);
  }
  for (const std::string& note : result.notes) {
    report.paragraph(note);
  }
  for (const std::string& warning : result.warnings) {
    report.paragraph("Warning: " + warning);
  }
  report.write(path);
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Simulates a scene file and writes its gauges as JSON.");
  std::string scene_file, json_file, vtk_folder, report_file;
  int threads = 0;
  app.add_option("scene", scene_file, "Scene file (JSON)")->required();
  app.add_option("--json", json_file, "Where the series and figures go")->required();
  app.add_option("--vtk", vtk_folder, "Folder for VTK files; open its all.pvd in ParaView");
  app.add_option("--report", report_file, "HTML report with charts and pictures");
  app.add_option("--threads", threads, "Number of threads, 0 for all")->check(CLI::Range(0, 1024));
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  try {
    const decant::Scene scene = decant::read_scene(scene_file);
    example::expect_writable(json_file);
    example::RunOptions options;
    options.threads = threads;
    options.pictures = !report_file.empty();
    if (!vtk_folder.empty()) {
      options.vtk_folder = vtk_folder;
    }
    const example::RunResult result = example::run_composition(scene, options);
    example::write_result(json_file, example::result_json(result, decant::Threads{threads}.resolved()));
    std::fputs(summary(result).text().c_str(), stdout);
    for (const std::string& note : result.notes) {
      std::printf("%s\n", note.c_str());
    }
    std::printf("series: %s\n", json_file.c_str());
    if (!report_file.empty()) {
      write_report(report_file, scene, result);
      std::printf("report: %s\n", report_file.c_str());
    }
    if (!vtk_folder.empty()) {
      std::printf("VTK:    %s/all.pvd\n", vtk_folder.c_str());
    }
    return result.status == "ok" ? 0 : 1;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "simulate: %s\n", error.what());
    return 2;
  }
}
