// SPDX-License-Identifier: MIT
// The discharge coefficient of a hole through which a tank drains, from a recording of its level, without particles:
//   drain_tank FOLDER --json OUT.json --report OUT.html
// The folder is that of G. Fabusola and C. M. Simon, Chem. Eng. Sci. 309 (2025) 121488, with
// liq_level_data_empty_train.csv and level_sensor_calibration.csv.
// With --assumed 0.8, also what a model lacks that takes the coefficient for that: the search for missing effects, on a
// model without particles and cameras.
//
// Exit status 0: done; 2: a file or an argument is wrong.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <decant/io/detail/text.hpp>
#include <decant/io/report.hpp>
#include <decant/io/table.hpp>

#include "support/draining_tank.hpp"
#include "support/draining_tank_effects.hpp"
#include "support/json_result.hpp"
#include "support/missing_effect_output.hpp"
#include "support/tool.hpp"

namespace {

using decant::detail::fixed_text;

/// A way to take the level at the beginning, and what came of it.
struct Answer {
  std::string key, start;  ///< for scripts, and for readers
  example::DrainFit fit;
};

decant::Table table_of(const std::vector<Answer>& answers) {
  decant::Table table({"level at the beginning", "coefficient", "from", "to", "off by [mm]", "independent errors"});
  for (const Answer& answer : answers) {
    const auto& c = answer.fit.coefficient;
    table.add({answer.start, fixed_text(c.median, 3), fixed_text(c.low, 3), fixed_text(c.high, 3),
               fixed_text(1e3 * answer.fit.mean_off, 1), fixed_text(answer.fit.independent_errors, 0)});
  }
  return table;
}

nlohmann::json to_json(const std::vector<Answer>& answers, const example::DrainRecord& record) {
  nlohmann::json json;
  for (const Answer& answer : answers) {
    const auto& c = answer.fit.coefficient;
    const auto& series = answer.fit.series;
    json[answer.key] = {
        {"coefficient", c.median},
        {"interval_90", {c.low, c.high}},
        {"at_end", c.at_end},
        {"start_level_m", series.hypotheses[series.posterior.best()][1]},
        {"mean_off_m", answer.fit.mean_off},
        {"readings_per_error", series.noise[0].readings_per_error},
        {"independent_errors", answer.fit.independent_errors},
        {"none_of_these", series.posterior.probability_of_none()},
        {"predicted_level_m", example::column_json(series.best()[0])},
    };
  }
  json["time_s"] = example::column_json(record.time);
  json["level_m"] = example::column_json(record.level);
  json["calibration_error_m"] = record.calibration_error;
  return json;
}

std::vector<double> in(double unit, const std::vector<double>& values) {
  std::vector<double> result;
  for (const double value : values) {
    result.push_back(value / unit);
  }
  return result;
}

std::string diagnosis_text(const example::DrainDiagnosis& diagnosis) {
  return example::missing_effect_sentence(diagnosis.result.judged, diagnosis.result) +
         " Levels of the second half, which was not learnt from, are off by " +
         fixed_text(1e3 * diagnosis.off_before, 1) + " mm as assumed, and by " +
         fixed_text(1e3 * diagnosis.off_after, 1) + " mm with what was found.";
}

/// @param diagnosis nullptr: none.
void write_report(const std::string& file, const std::vector<Answer>& answers, const example::DrainRecord& record,
                  const example::DrainDiagnosis* diagnosis) {
  decant::HtmlReport report("How well a hole lets water pass");
  report.paragraph("A tank drains through a hole by Torricelli's law, A(h) dh/dt = -c a sqrt(2 g (h - z)). Of " +
                   std::to_string(record.time.size()) +
                   " readings of its level only few err independently, since the sensor's calibration is off by " +
                   fixed_text(1e3 * record.calibration_error, 0) +
                   " mm over centimetres of level; from .. to is the 90 % interval that this leaves.");
  report.table(table_of(answers));
  decant::LineChart levels{"Level", "time [s]", "level [cm]", {{"measured", record.time, in(0.01, record.level)}}};
  decant::LineChart off{"Predicted minus measured level", "time [s]", "off by [mm]", {}};
  decant::LineChart density{"What is known of the coefficient", "coefficient", "density over its highest", {}, {}, {0}};
  for (const Answer& answer : answers) {
    const std::vector<double>& best = answer.fit.series.best()[0];
    levels.lines.push_back({"start " + answer.start, record.time, in(0.01, best), true});
    std::vector<double> difference;
    for (std::size_t k = 0; k < best.size(); ++k) {
      difference.push_back(1e3 * (best[k] - record.level[k]));
    }
    off.lines.push_back({"start " + answer.start, record.time, difference});
    decant::Marginal c = answer.fit.series.marginal_of(0);
    const double highest = *std::max_element(c.log_density.begin(), c.log_density.end());
    for (double& value : c.log_density) {
      value = std::exp(value - highest);
    }
    density.lines.push_back({"start " + answer.start, c.values, c.log_density});
  }
  report.chart(levels);
  report.chart(off);
  report.chart(density);
  const example::DrainCourse course =
      example::follow_discharge(answers.front().fit, record, std::max<std::size_t>(1, record.time.size() / 200));
  std::vector<double> median, low, high;
  for (const decant::ValueEstimate& c : course.coefficient) {
    median.push_back(c.median);
    low.push_back(c.low);
    high.push_back(c.high);
  }
  report.chart({"As it would have been known while the tank drained, start " + answers.front().start,
                "time [s]",
                "coefficient",
                {{"median", course.time, median}, {"from", course.time, low, true}, {"to", course.time, high, true}}});
  if (diagnosis != nullptr) {
    report.heading("What a model lacks that assumes a coefficient");
    report.paragraph(diagnosis_text(*diagnosis));
    report.table(example::gap_table(diagnosis->result));
    report.table(example::candidates_table(diagnosis->result.judged, diagnosis->result));
    report.table(example::where_read_table({"first half"}, {{"level"}}, diagnosis->result));
    report.chart({"Level by that model; the second half begins anew where it was read",
                  "time [s]",
                  "level [cm]",
                  {{"measured", record.time, in(0.01, record.level)},
                   {"as assumed", record.time, in(0.01, diagnosis->assumed)},
                   {"with what was found", record.time, in(0.01, diagnosis->mended)}}});
  }
  report.write(file);
}

}  // namespace

int main(int count, char** values) {
  std::string folder, json_file, report_file;
  decant::Threads threads;
  std::optional<double> assumed;
  CLI::App app("Finds the discharge coefficient of a hole from the level of the tank that it drains.");
  app.add_option("folder", folder, "with the level's readings and the sensor's calibration")->required();
  app.add_option("--json", json_file, "writes coefficients, intervals and levels");
  app.add_option("--report", report_file, "writes a page with charts, for a browser");
  app.add_option("--assumed", assumed, "what a model lacks that takes the coefficient for that")
      ->check(CLI::Range(0.3, 1.2));
  app.add_option("--threads", threads.count, "0: all")->check(CLI::Range(0, 1024));
  return example::run_tool(app, count, values, [&] {
    example::expect_writable({json_file, report_file});
    const example::DrainingTank tank = example::tank_fabusola2025();
    const example::DrainRecord record = example::read_drain_record(folder);
    std::vector<Answer> answers;
    answers.push_back({"as_read", "as read", example::fit_discharge(tank, record, 0, threads)});
    answers.push_back({"as_unsure_as_others", "as unsure as other readings",
                       example::fit_discharge(tank, record, record.calibration_error, threads)});
    std::fputs(table_of(answers).text().c_str(), stdout);
    std::optional<example::DrainDiagnosis> diagnosis;
    if (assumed) {
      diagnosis = example::diagnose_drain(tank, record, *assumed, threads);
      std::printf("%s\n%s", diagnosis_text(*diagnosis).c_str(),
                  example::candidates_table(diagnosis->result.judged, diagnosis->result).text().c_str());
    }
    if (!json_file.empty()) {
      nlohmann::json json = to_json(answers, record);
      if (diagnosis) {
        json["missing"] =
            example::missing_effect_json(diagnosis->result.judged, diagnosis->result, {0, 0, -tank.gravity});
        json["missing"]["held_out_level_off_m"] = {{"before", diagnosis->off_before}, {"after", diagnosis->off_after}};
      }
      example::write_result(json_file, json);
    }
    if (!report_file.empty()) {
      write_report(report_file, answers, record, diagnosis ? &*diagnosis : nullptr);
    }
    return 0;
  });
}
