// SPDX-License-Identifier: MIT
/// How well a search finds where and when an effect acts, on films of thrown balls that are made in an instant: a tap
/// at places that are not the usual one, a pull for a while at other times than usual, a pull in beats; and how well
/// two of those that there are at once are named. What is left of a gap is set beside what would be left if nothing
/// were missing.

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include <decant/discovery/missing_effect.hpp>
#include <decant/hypothesis/thread_executor.hpp>

#include "common.hpp"
#include "discovery/jet_model.hpp"
#include "discovery/pull_models.hpp"

namespace {

using namespace decant_benchmark;
using namespace decant;
using decant_test::film_of;
using decant_test::Jet;

/// Figures of one kind of film, one number a film.
class Figures {
 public:
  explicit Figures(std::string title) : title_(std::move(title)) {}

  /// How large something is, of which the mean is reported.
  void add(const std::string& name, const std::string& unit, double value) {
    figure(name, unit, false).push_back(value);
  }
  /// How far something is off, of which the root of the mean square is.
  void add_off(const std::string& name, const std::string& unit, double value) {
    figure(name + " off by (RMS)", unit, true).push_back(value);
  }

  void report(Report& report, long films, int threads) const {
    report.heading(title_, films, threads);
    for (const Figure& each : figures_) {
      double mean = 0;
      for (const double value : each.values) {
        mean += (each.is_off ? value * value : value) / static_cast<double>(each.values.size());
      }
      report.add(title_, {.name = each.name,
                          .size = static_cast<long>(each.values.size()),
                          .threads = threads,
                          .value = each.is_off ? std::sqrt(mean) : mean,
                          .unit = each.unit});
    }
  }

 private:
  struct Figure {
    std::string name, unit;
    bool is_off;
    std::vector<double> values{};
  };

  std::vector<double>& figure(const std::string& name, const std::string& unit, bool is_off) {
    for (Figure& each : figures_) {
      if (each.name == name) {
        return each.values;
      }
    }
    return figures_.emplace_back(Figure{name, unit, is_off}).values;
  }

  std::string title_;
  std::vector<Figure> figures_{};
};

/// @param hidden number of the effect. @param compare(found) notes what is off by how much.
template <class Model, class Compare>
void search(const Model& model, const Jet& jet, std::uint32_t seed, std::size_t hidden, int threads, Figures& figures,
            Compare compare) {
  ThreadExecutor executor{{threads}};
  const MissingEffect found =
      MissingEffectSearch<Model>({{"film", &model, film_of(jet, seed)}}, {}, run_jobs_on(executor)).find();
  const bool right = !found.refined.empty() && found.refined.front().effect == hidden;
  figures.add("the right effect is the nearest one", "%", right ? 100 : 0);
  figures.add("runs for an answer", "", static_cast<double>(found.runs));
  if (right) {
    const RefinedEffect& effect = found.refined.front();
    figures.add("left, over what is left where nothing is missing", "x", effect.distance / found.learn.noise);
    compare(effect);
  }
}

/// Of what is hidden in a film: numbers of a JetModel's effects, with strengths.
using Hidden = std::map<std::size_t, double>;

/// Learns from one film, and checks on another, of a nozzle that points elsewhere.
void search_two(const Jet& jet, const Hidden& hidden, std::uint32_t seed, int threads, Figures& figures) {
  constexpr double angle = 0.9, other_angle = 0.6;
  const Vector3<double> usual(0.15, 0.6, 0);
  const decant_test::LocatingJetModel model(angle, usual), other(other_angle, usual);
  ThreadExecutor executor{{threads}};
  const MissingEffect result = MissingEffectSearch<decant_test::LocatingJetModel>(
                                   {{"film", &model, film_of(jet, seed, angle)}},
                                   {{"other", &other, film_of(jet, seed + 500, other_angle)}}, run_jobs_on(executor))
                                   .find();
  std::size_t right = 0;
  for (const RefinedEffect& each : result.found) {
    right += hidden.contains(each.effect) ? 1 : 0;
  }
  const bool named = result.verdict == Verdict::Named && right == result.found.size();
  figures.add("both are named, and nothing else", "%", named && right == 2 ? 100 : 0);
  figures.add("one is named, and stands for both", "%", named && right == 1 ? 100 : 0);
  figures.add("unexplained, or a set", "%", result.verdict != Verdict::Named ? 100 : 0);
  figures.add("what is not there is named", "%", result.verdict == Verdict::Named && !named ? 100 : 0);
  figures.add("runs for an answer", "", static_cast<double>(result.runs));
  for (const RefinedEffect& each : result.found) {
    if (named && right == 2) {
      figures.add_off("strengths of both", "%", 100 * (each.strength[0] / hidden.at(each.effect) - 1));
    }
  }
}

void measure(const Options& options, Report& report) {
  const int threads = options.numbers("threads").front(), repetitions = options.numbers("repetitions").front();
  if (const std::string title = "a tap that is not where it usually is"; report.wants(title)) {
    Figures figures(title);
    long films = 0;
    const decant_test::LocatingJetModel model(0.9, Vector3<double>(0.15, 0.6, 0));
    for (const auto& [place_x, place_y] :
         {std::pair{0.22, 0.67}, {0.3, 0.65}, {0.18, 0.55}, {0.1, 0.62}, {0.15, 0.6}}) {
      const double x = place_x, y = place_y;  // which a lambda may capture
      for (int k = 0; k < repetitions; ++k, ++films) {
        Jet jet;
        jet.tap = 25;
        jet.tap_x = x;
        jet.tap_y = y;
        search(model, jet, 71 + static_cast<std::uint32_t>(k), 5, threads, figures, [&](const RefinedEffect& tap) {
          figures.add_off("place in the picture", "mm", 1e3 * (*tap.place - Vector3<double>(x, y, 0)).head<2>().norm());
          figures.add_off("strength", "%", 100 * (tap.strength[0] / jet.tap - 1));
        });
      }
    }
    figures.report(report, films, threads);
  }
  if (const std::string title = "a pull for a while"; report.wants(title)) {
    Figures figures(title);
    const decant_test::PullModel model;
    const int films = 6 * repetitions;
    for (int k = 0; k < films; ++k) {
      Jet jet;
      jet.gust = (k % 2 == 0 ? 1 : -1) * (1.2 + 0.15 * (k % 5));
      jet.gust_from = 0.12 + 0.08 * (k % 4);
      jet.gust_until = jet.gust_from + 0.3 + 0.1 * (k % 3);
      search(model, jet, 900 + static_cast<std::uint32_t>(k), decant_test::PullModel::passing, threads, figures,
             [&](const RefinedEffect& pull) {
               figures.add_off("begin", "ms", 1e3 * (pull.window->from - jet.gust_from));
               figures.add_off("end", "ms", 1e3 * (pull.window->until - jet.gust_until));
               figures.add_off("strength", "%", 100 * (pull.strength[0] / jet.gust - 1));
             });
    }
    figures.report(report, films, threads);
  }
  if (const std::string title = "a pull in beats"; report.wants(title)) {
    Figures figures(title);
    const decant_test::BeatModel model;
    const int films = 4 * repetitions;
    for (int k = 0; k < films; ++k) {
      const double period = 0.31 + 0.05 * (k % 4);
      Jet jet;
      jet.pull = 1 + 0.1 * (k % 5);
      jet.beat_from = 0.5 + 0.03 * k;
      jet.beat_until = jet.beat_from + period;
      search(model, jet, 700 + static_cast<std::uint32_t>(k), decant_test::BeatModel::pull, threads, figures,
             [&](const RefinedEffect& pull) {
               figures.add("beats are found", "%", pull.window ? 100 : 0);
               figures.add_off("strength", "%", 100 * (pull.strength[0] / jet.pull - 1));
               if (pull.window) {
                 figures.add_off("period", "%", 100 * ((pull.window->until - pull.window->from) / period - 1));
               }
             });
    }
    figures.report(report, films, threads);
  }
  if (const std::string title = "two at once"; report.wants(title)) {
    Figures figures(title);
    long films = 0;
    const auto hide = [&](const Jet& jet, const Hidden& hidden) {
      for (int k = 0; k < repetitions; ++k, ++films) {
        search_two(jet, hidden, 300 + static_cast<std::uint32_t>(films), threads, figures);
      }
    };
    constexpr std::size_t drag = 0, pull = 1, speed = 2, late = 3, tap = 5;
    Jet tapped;
    tapped.tap = 25;
    tapped.tap_x = 0.22;
    tapped.tap_y = 0.67;
    const auto tapped_and = [&](double Jet::*which, double strength) {
      Jet jet = tapped;
      jet.*which = strength;
      return jet;
    };
    hide(tapped_and(&Jet::drag, 0.6), {{tap, 25}, {drag, 0.6}});
    hide(tapped_and(&Jet::pull, 0.8), {{tap, 25}, {pull, 0.8}});
    hide(tapped_and(&Jet::late, 0.05), {{tap, 25}, {late, 0.05}});
    hide({.drag = 0.8, .late = 0.05}, {{drag, 0.8}, {late, 0.05}});
    hide({.drag = 0.6, .pull = -0.8}, {{drag, 0.6}, {pull, -0.8}});
    hide({.pull = 0.8, .speed = 1.08}, {{pull, 0.8}, {speed, 1.08}});
    hide({.pull = 0.8, .late = 0.05}, {{pull, 0.8}, {late, 0.05}});
    figures.report(report, films, threads);
  }
}

}  // namespace

int main(int argc, char** argv) {
  Options options("bench_effect_search", "where and when effects are found to act, on films of thrown balls");
  options.add("threads", "2", "over which runs are shared out; the number of cores")
      .add("repetitions", "4", "films of each place, and of other things in proportion");
  return benchmark_main(argc, argv, options, measure);
}
