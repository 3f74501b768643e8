// SPDX-License-Identifier: MIT

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <random>
#include <vector>

#include <decant/hypothesis/posterior.hpp>

#include "catch.hpp"

using namespace decant;

namespace {

double sum_of(const Posterior& posterior) {
  double total = posterior.probability_of_none();
  for (std::size_t k = 0; k < posterior.size(); ++k) {
    total += posterior.probability(k);
  }
  return total;
}

/// Hypotheses with these sums of squares, of which none is ruled out by size alone.
Posterior seen(const std::vector<double>& squared, double measured, const PosteriorSettings& settings = {}) {
  Posterior posterior(settings);
  for (const double each : squared) {
    posterior.observe(posterior.add(), {each, measured});
  }
  return posterior;
}

}  // namespace

TEST_CASE("posterior: before anything is seen it is the prior") {
  PosteriorSettings settings;
  settings.none_prior = 0.2;
  Posterior posterior(settings);
  posterior.add(std::log(6.0));
  posterior.add(std::log(2.0));
  CHECK(posterior.probability(0) == Approx(0.6));
  CHECK(posterior.probability(1) == Approx(0.2));
  CHECK(posterior.probability_of_none() == Approx(0.2));
  CHECK(posterior.best() == 0);
}

TEST_CASE("posterior: the likelihood is that of a variance that is integrated out") {
  // Differences d_1 .. d_n, normal with variance s; s has the inverse-gamma density of shape a and scale b, in the
  // limit of small a, where the likelihood is (b + D / 2)^-(n / 2) up to a constant. Here by quadrature over log s.
  PosteriorSettings settings;
  settings.independent_errors = 7;
  settings.least_squared = 3;
  const Posterior posterior(settings);
  const auto integrated = [&](double squared) {
    const double b = settings.least_squared / 2;
    double total = 0;
    for (double log_s = -12; log_s < 40; log_s += 1e-3) {
      const double s = std::exp(log_s);
      total += std::pow(s, -settings.independent_errors / 2) * std::exp(-(squared / 2 + b) / s) * 1e-3;
    }
    return std::log(total);
  };
  for (const double squared : {0.5, 4.0, 60.0}) {
    CHECK(posterior.log_likelihood(squared) == Approx(integrated(squared) - integrated(0)).margin(1e-4));
  }
}

TEST_CASE("posterior: ratios of misfits count, and not their sizes") {
  const auto small = seen({100, 200}, 1000), large = seen({1000, 2000}, 10000);
  const auto lead = [](const Posterior& posterior) { return posterior.log_posterior(0) - posterior.log_posterior(1); };
  CHECK(lead(small) == Approx(lead(large)).epsilon(0.05));
  CHECK(lead(small) > 5);
  CHECK(small.best() == 0);
  CHECK(sum_of(small) == Approx(1));
}

TEST_CASE("posterior: none of these, if all are far from what was measured") {
  CHECK(seen({100, 300}, 1000).probability_of_none() < 1e-6);
  const auto lost = seen({900, 950}, 1000);
  CHECK(lost.probability_of_none() > 0.5);
  CHECK(sum_of(lost) == Approx(1));
  PosteriorSettings certain;
  certain.none_prior = 0;
  CHECK(seen({900, 950}, 1000, certain).probability_of_none() == 0);
  CHECK(sum_of(seen({900, 950}, 1000, certain)) == Approx(1));
}

TEST_CASE("posterior: nothing was there, and one hypothesis had said so") {
  const auto empty = seen({0, 400, 800, 1200}, 0);
  CHECK(empty.probability(0) > 0.999);
  // where all said so, or nothing was to be seen, nothing is known about none of these
  CHECK(seen({0, 0}, 0).probability_of_none() == Approx(PosteriorSettings{}.none_prior));
  // what others had predicted until they were given up still counts
  auto pruned = seen({0, 400, 800, 1200}, 0);
  pruned.exclude(2);
  pruned.exclude(3);
  CHECK(pruned.log_posterior_of_none() == empty.log_posterior_of_none());
  // nor can an excluded one that broke spoil it
  auto broken = seen({100, std::numeric_limits<double>::quiet_NaN()}, 1000);
  CHECK(broken.log_posterior_of_none() < 0);
  CHECK(sum_of(broken) == Approx(1));
}

TEST_CASE("posterior: what is stated comes true as often, however large errors are") {
  // One of four predictions is right but for errors whose size nobody is told, from a hundredth of what the predictions
  // differ by to ten times as much. Twenty errors, as many as the posterior takes there to be.
  PosteriorSettings settings;
  settings.none_prior = 0;
  settings.least_squared = 1e-3;  // below what the smallest errors come to
  constexpr int cases = 20000, count = 4, bins = 5;
  const int errors = static_cast<int>(settings.independent_errors);
  std::mt19937 random(17);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> log_size(std::log(0.01), std::log(10.0));
  std::array<double, bins> stated{}, came_true{}, statements{};
  for (int k = 0; k < cases; ++k) {
    const double size = std::exp(log_size(random));
    const auto right = static_cast<std::size_t>(random() % count);
    std::array<double, count> squared{};
    for (int error = 0; error < errors; ++error) {
      std::array<double, count> prediction{};
      for (double& each : prediction) {
        each = normal(random);
      }
      const double measured = prediction[right] + size * normal(random);
      for (std::size_t h = 0; h < count; ++h) {
        squared[h] += (prediction[h] - measured) * (prediction[h] - measured);
      }
    }
    const Posterior posterior = seen({squared.begin(), squared.end()}, 1, settings);
    for (std::size_t h = 0; h < count; ++h) {
      const double probability = posterior.probability(h);
      const auto bin = static_cast<std::size_t>(std::min(bins - 1, static_cast<int>(bins * probability)));
      stated[bin] += probability;
      came_true[bin] += h == right ? 1 : 0;
      ++statements[bin];
    }
  }
  for (std::size_t bin = 0; bin < bins; ++bin) {
    const double mean = stated[bin] / statements[bin];
    INFO(mean << " stated " << statements[bin] << " times");
    CHECK(statements[bin] > 300);
    // four deviations of a frequency; 0.01 for sizes having ends, which the posterior does not know
    CHECK(came_true[bin] / statements[bin] ==
          Approx(mean).margin(0.01 + 4 * std::sqrt(mean * (1 - mean) / statements[bin])));
  }
}

TEST_CASE("posterior: ten thousand frames neither underflow nor forget") {
  Posterior posterior;
  posterior.add();
  posterior.add();
  for (int frame = 0; frame < 10000; ++frame) {
    posterior.observe(0, {3, 40});
    posterior.observe(1, {3.3, 40});
  }
  CHECK(std::isfinite(posterior.log_posterior(1)));
  const double n = posterior.settings().independent_errors;
  CHECK(posterior.log_posterior(0) - posterior.log_posterior(1) == Approx(0.5 * n * std::log(1.1)).epsilon(1e-3));
  CHECK(sum_of(posterior) == Approx(1));

  // so far apart that no double could hold the likelihoods
  PosteriorSettings sure;
  sure.independent_errors = 1e6;
  const auto apart = seen({1, 1e9}, 1e9, sure);
  CHECK(apart.probability(0) == Approx(1));
  CHECK(apart.probability(1) == 0);
  CHECK(sum_of(apart) == Approx(1));
}

TEST_CASE("posterior: what is not a number excludes a hypothesis, and nothing else") {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  Posterior posterior;
  posterior.add();
  posterior.add();
  posterior.observe(0, {nan, 10});
  posterior.observe(1, {1, 10});
  CHECK(posterior.excluded(0));
  CHECK(posterior.probability(0) == 0);
  CHECK(posterior.best() == 1);
  CHECK(sum_of(posterior) == Approx(1));
  posterior.exclude(1);
  CHECK(posterior.probability_of_none() == Approx(1));
}

TEST_CASE("posterior: what several sources say is multiplied") {
  const EvidenceSettings scale{6, 6, 0.1};
  Posterior both;
  const std::size_t source = both.add_source(scale);
  CHECK(source == 1);
  CHECK(both.sources() == 2);
  Posterior masks, alone({scale.independent_errors, scale.least_squared, scale.hopeless_share});
  const std::vector<Misfit> seen_by_masks{{100, 1000}, {140, 1000}}, weighed{{3, 900}, {50, 900}};
  for (std::size_t k = 0; k < 2; ++k) {
    both.observe(both.add(), seen_by_masks[k]);
    both.observe(k, weighed[k], source);
    masks.observe(masks.add(), seen_by_masks[k]);
    alone.observe(alone.add(), weighed[k]);
    CHECK(both.misfit(k).squared == seen_by_masks[k].squared);
    CHECK(both.misfit(k, source).squared == weighed[k].squared);
  }
  // odds of hypotheses are products of those of the sources
  const auto odds = [](const Posterior& posterior, std::size_t k) {
    return posterior.probability(k) / posterior.probability(0);
  };
  CHECK(odds(both, 1) == Approx(odds(masks, 1) * odds(alone, 1)));
  CHECK(sum_of(both) == Approx(1));

  // a source by which all are equally far off takes nothing from what another says
  both.observe(0, {1e9, 0}, source);
  both.observe(1, {1e9, 0}, source);
  CHECK(odds(both, 1) == Approx(odds(masks, 1)));
  both.observe(1, {std::nan(""), 0}, source);
  CHECK(both.excluded(1));
  CHECK_THROWS_WITH(both.add_source(scale), Catch::Contains("before a source is added"));
}

TEST_CASE("posterior: none of these may show in one source alone") {
  const EvidenceSettings scale{6, 6, 0.1};
  const double none_prior = PosteriorSettings{}.none_prior;
  const auto weighed = [&](std::vector<double> by_masks, std::vector<double> by_scale) {
    Posterior posterior;
    posterior.add_source(scale);
    for (std::size_t k = 0; k < by_masks.size(); ++k) {
      posterior.observe(posterior.add(), {by_masks[k], 1000});
      posterior.observe(k, {by_scale[k], 900}, 1);
    }
    return posterior;
  };
  // masks have one hypothesis right, and the scale has none
  const Posterior split = weighed({20, 300}, {700, 800});
  CHECK(split.probability_of_none() > 0.5);
  CHECK(weighed({20, 300}, {3, 50}).probability_of_none() < 1e-3);
  CHECK(weighed({900, 950}, {700, 800}).probability_of_none() > 0.9);
  CHECK(sum_of(split) == Approx(1));

  // by the sets of sources that it may show in: masks, scale, both
  const double masks_off = 1000 * PosteriorSettings{}.hopeless_share, scale_off = 900 * scale.hopeless_share;
  double sum = 0;
  for (const auto& [mask, level] : {std::pair{20.0, 700.0}, {300.0, 800.0}}) {
    for (const auto& [one, two] : {std::pair{masks_off, level}, {mask, scale_off}, {masks_off, scale_off}}) {
      sum += std::exp(split.log_likelihood(one) + split.log_likelihood(two, 1)) / 3;
    }
  }
  CHECK(split.log_posterior_of_none() == Approx(std::log(none_prior / (1 - none_prior) * sum)));

  // a source that has measured nothing yet has no say in it
  Posterior masks, both;
  both.add_source(scale);
  for (Posterior* posterior : {&masks, &both}) {
    CHECK(posterior->log_posterior_of_none() == -std::numeric_limits<double>::infinity());
    posterior->observe(posterior->add(), {20, 1000});
    posterior->observe(posterior->add(), {300, 1000});
  }
  CHECK(both.log_posterior_of_none() == Approx(masks.log_posterior_of_none()));
  // one that was given up helps none of these no more than it did
  Posterior pruned = weighed({20, 300}, {700, 800});
  pruned.exclude(1);
  CHECK(pruned.log_posterior_of_none() < split.log_posterior_of_none());
}

TEST_CASE("posterior: settings out of range are refused") {
  const auto with = [](auto set) {
    PosteriorSettings settings;
    set(settings);
    return Posterior(settings);
  };
  CHECK_THROWS_WITH(with([](auto& s) { s.independent_errors = 0; }), Catch::Contains("independent_errors"));
  CHECK_THROWS_WITH(with([](auto& s) { s.least_squared = -1; }), Catch::Contains("least_squared"));
  CHECK_THROWS_WITH(with([](auto& s) { s.hopeless_share = 1.5; }), Catch::Contains("hopeless_share"));
  CHECK_THROWS_WITH(with([](auto& s) { s.none_prior = 1; }), Catch::Contains("none_prior"));
  CHECK_THROWS_WITH(Posterior().add(std::nan("")), Catch::Contains("log_prior"));
}
