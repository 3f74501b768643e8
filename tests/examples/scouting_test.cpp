// SPDX-License-Identifier: MIT
// Hypotheses in coarse particles first: which are worth fine ones, and what is known of all of them then.

#include "../../examples/support/scouting.hpp"

#include <cmath>
#include <cstddef>
#include <vector>

#include "catch.hpp"

using namespace example;

namespace {

/// Five in a row, as probable as each other but for the first, over two frames.
PosteriorCourse scouted_row() {
  PosteriorCourse course;
  course.names = {"a", "b", "c", "d", "e"};
  course.time = {0, 1};
  course.log_posterior = {{-2, -9}, {0, -7}, {-1, -2}, {0, 0}, {-3, -9}};
  course.log_none = {-4, -12};
  course.evidence.resize(5);
  course.evidence[0].before.squared = 11;
  course.evidence[3].before.squared = 33;
  course.followed = {5, 4};
  course.frames_run = 10;
  return course;
}

HypothesisSet row() {
  HypothesisSet set;
  set.names = {"a", "b", "c", "d", "e"};
  set.log_prior = {0, 0, std::log(0.5), 0, 0};
  set.neighbours = [](std::size_t a, std::size_t b) { return a + 1 == b || b + 1 == a; };
  return set;
}

}  // namespace

TEST_CASE("scouting: probable hypotheses and their neighbours are worth fine particles") {
  // at a share of e^-3 c and d are probable, and b and e are next to one of them
  CHECK(worth_following(scouted_row(), row(), std::exp(-3.0)) == std::vector<std::size_t>{1, 2, 3, 4});
  CHECK(worth_following(scouted_row(), row(), std::exp(-1.0)) == std::vector<std::size_t>{2, 3, 4});
  CHECK(worth_following(scouted_row(), row(), std::exp(-8.0)) == std::vector<std::size_t>{0, 1, 2, 3, 4});
}

TEST_CASE("scouting: hypotheses that were not followed again stay as far behind, in each frame") {
  const PosteriorCourse scouted = scouted_row();
  PosteriorCourse fine;
  fine.names = {"c", "d"};
  fine.time = scouted.time;
  fine.log_posterior = {{-10, -12}, {-11, -20}};
  fine.log_none = {-14, -30};
  fine.evidence.resize(2);
  fine.evidence[1].before.squared = 44;
  fine.followed = {2, 2};
  fine.frames_run = 4;
  const PosteriorCourse course = joined_courses(fine, {2, 3}, scouted, row().log_prior);
  CHECK(course.names == scouted.names);
  CHECK(course.log_posterior[2] == fine.log_posterior[0]);
  CHECK(course.log_posterior[3] == fine.log_posterior[1]);
  // the best of c and d had 0 and 0 in coarse particles, -10 and -12 in fine ones
  CHECK(course.log_posterior[0] == std::vector<double>{-12, -21});
  CHECK(course.log_posterior[4] == std::vector<double>{-13, -21});
  CHECK(course.evidence[0].before.squared == 11);
  CHECK(course.evidence[3].before.squared == 44);
  CHECK(course.followed == fine.followed);
  CHECK(course.frames_run == 4);
  CHECK(course.scouted_frames_run == 10);
  // "none of these" had its share of c and d, 1.5 of 4.5
  CHECK(course.log_none[0] == Approx(-14 + std::log(3.0)));
  CHECK(course.log_none[1] == Approx(-30 + std::log(3.0)));
}

TEST_CASE("scouting: a run that stopped early has that many frames") {
  PosteriorCourse fine;
  fine.names = {"d"};
  fine.time = {0};
  fine.log_posterior = {{-11}};
  fine.log_none = {-14};
  fine.evidence.resize(1);
  fine.status = "stopped";
  const PosteriorCourse course = joined_courses(fine, {3}, scouted_row(), row().log_prior);
  CHECK(course.status == "stopped");
  for (const std::vector<double>& each : course.log_posterior) {
    CHECK(each.size() == 1);
  }
  CHECK(course.probability()[0].size() == 1);
}
