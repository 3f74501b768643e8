// SPDX-License-Identifier: MIT
#pragma once

/// The laws of a NeighborSearch.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <random>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <decant/core/target.hpp>
#include <decant/neighbor/brute_force.hpp>
#include <decant/neighbor/concept.hpp>
#include <decant/testing/law.hpp>

namespace decant::inline DECANT_TARGET::testing {

/// A cloud of particles that searches find hard, in units of a support radius of 1.
template <class Scalar>
struct NeighborCase {
  std::string name;
  PointArray<Scalar> position;
};

/// The clouds that neighbor_laws tries. With a seed of its own generator, so they are the same on every machine.
template <std::floating_point Scalar>
std::vector<NeighborCase<Scalar>> neighbor_cases() {
  using Points = PointArray<Scalar>;
  using Point = Vector3<Scalar>;
  std::mt19937 generator(20170712);
  const auto uniform = [&generator](double low, double high) {  // the standard's distributions differ by library
    return low + (high - low) * (static_cast<double>(generator()) / 4294967296.0);
  };
  const auto cloud = [&uniform](Index count, double size) {
    Points points(3, count);
    for (Index i = 0; i < points.size(); ++i) {
      points.data()[i] = static_cast<Scalar>(uniform(-size / 2, size / 2));
    }
    return points;
  };
  const auto beside = [](const Points& a, const Points& b) {
    Points both(3, a.cols() + b.cols());
    both << a, b;
    return both;
  };
  // A liquid at rest, about 8 particles per cubed support radius, turned and shuffled.
  Points liquid(3, 9 * 9 * 9);
  {
    const Matrix3<double> turn =
        (Eigen::AngleAxisd(0.9, Vector3<double>::UnitZ()) * Eigen::AngleAxisd(0.5, Vector3<double>::UnitX()) *
         Eigen::AngleAxisd(0.3, Vector3<double>::UnitY()))
            .toRotationMatrix();
    for (Index i = 0; i < liquid.cols(); ++i) {
      const Vector3<double> corner(static_cast<double>(i % 9), static_cast<double>(i / 9 % 9),
                                   static_cast<double>(i / 81));
      const Vector3<double> jitter(uniform(-0.1, 0.1), uniform(-0.1, 0.1), uniform(-0.1, 0.1));
      liquid.col(i) = (turn * (corner + jitter) * 0.5).template cast<Scalar>();
    }
    for (Index i = liquid.cols() - 1; i > 0; --i) {
      liquid.col(i).swap(liquid.col(static_cast<Index>(generator() % static_cast<unsigned>(i + 1))));
    }
  }
  // On the corners of cells, in steps of half and whole support radii: pairs at exactly the support radius, too.
  Points corners(3, 8 * 8 * 8);
  for (Index i = 0; i < corners.cols(); ++i) {
    corners.col(i) = Point(static_cast<Scalar>(i % 8), static_cast<Scalar>(i / 8 % 8), static_cast<Scalar>(i / 64)) / 2;
  }
  Points next_to_corners = corners;
  for (Index i = 0; i < next_to_corners.size(); ++i) {
    Scalar& value = next_to_corners.data()[i];
    value = i % 3 == 0 ? std::nextafter(value, Scalar(-100)) : i % 3 == 1 ? std::nextafter(value, Scalar(100)) : value;
  }
  Points same(3, 40);
  same.colwise() = Point(Scalar(-0.3), Scalar(0.2), Scalar(7));
  Points line = cloud(300, 2);
  line.row(0) *= Scalar(500);
  line.bottomRows(2) *= Scalar(0.1);
  Points hostile = cloud(200, 3);
  const Scalar nan = std::numeric_limits<Scalar>::quiet_NaN();
  const Scalar infinity = std::numeric_limits<Scalar>::infinity();
  const Scalar most = std::numeric_limits<Scalar>::max();
  hostile.col(3) = Point(nan, 0, 0);
  hostile.col(4) = Point(0, nan, 0);
  hostile.col(50) = Point(0, 0, infinity);
  hostile.col(51) = Point(-infinity, 0, nan);
  hostile.col(52) = Point(-infinity, 0, nan);
  Points not_a_number(3, 5);
  not_a_number.fill(nan);
  Points huge = hostile;
  huge.col(100) = Point(most, -most, 0);
  huge.col(101) = huge.col(100);
  huge.col(102) = Point(-most, most, most);
  huge.col(103) = Point(Scalar(1e30), 0, Scalar(1e30));
  Points gas = cloud(400, 1e6);  // a million cells per axis
  gas.rightCols(200) = gas.leftCols(200) + cloud(200, 1);
  Points two_clouds = beside(cloud(150, 3), cloud(150, 3));
  two_clouds.rightCols(150).colwise() += Point(Scalar(-4000), Scalar(50000), Scalar(1e6));
  Points spilled = liquid;
  spilled.col(0) = Point(0, Scalar(-1e5), 0);
  const Points far_off = cloud(300, 4).colwise() + Point(Scalar(1e4), Scalar(-2e4), Scalar(3e4));

  return {{"no particle", Points(3, 0)},
          {"one particle", Points::Constant(3, 1, Scalar(-3))},
          {"a liquid", liquid},
          {"a random cloud around the origin", cloud(500, 5)},
          {"particles on the corners of cells", corners},
          {"particles next to the corners of cells", next_to_corners},
          {"corners at negative coordinates", Points(-corners)},
          {"particles in one place", same},
          {"each particle twice", beside(liquid.leftCols(300), liquid.leftCols(300))},
          {"a line", line},
          {"some positions NaN or infinite", hostile},
          {"all positions NaN", not_a_number},
          {"coordinates up to the largest number", huge},
          {"a gas that fills a million cells per axis", gas},
          {"two clouds a million cells apart", two_clouds},
          {"a liquid and a particle that fell out", spilled},
          {"a cloud far from the origin", far_off}};
}

/// Tries the laws of a search, which may have been used before; its domain, if periodic, needs periods of 2 to 100.
/// Each error is a number of particles whose neighbours or distances differ from those of BruteForce. Takes some 10 ms.
template <NeighborSearch Search>
std::vector<Law> neighbor_laws(Search search) {
  using Scalar = typename Search::Scalar;
  using Found = std::vector<std::pair<Index, Scalar>>;
  using Domain = std::remove_cvref_t<decltype(search.domain())>;
  const auto neighbors = [](const auto& of, Index i) {
    Found found;
    of.for_each(i, [&found](Index j, Scalar r_squared) { found.emplace_back(j, r_squared); });
    return found;
  };
  const auto sorted = [](Found found) {
    std::sort(found.begin(), found.end());
    return found;
  };
  BruteForce<Scalar, Domain> reference(search.domain());
  std::vector<Law> laws;
  const auto compare = [&](const std::string& statement, const PointArray<Scalar>& position, Scalar radius) {
    search.rebuild(position, radius, Threads{1});
    reference.rebuild(position, radius);
    double wrong = search.size() == position.cols() ? 0 : 1;
    for (Index i = 0; i < position.cols(); ++i) {
      wrong += sorted(neighbors(search, i)) == sorted(neighbors(reference, i)) ? 0 : 1;
    }
    laws.push_back({statement, wrong, 0});
  };

  // Wrapping throws digits away: far coordinates in a periodic domain are as inexact as they are large.
  const auto within_reach = [](const PointArray<Scalar>& position) {
    return !Domain::periodic || !(position.array().isFinite().select(position.array().abs(), 0) > 1e3).any();
  };
  for (const NeighborCase<Scalar>& item : neighbor_cases<Scalar>()) {
    if (within_reach(item.position)) {
      compare("neighbours equal those of brute force: " + item.name, item.position, 1);
    }
  }
  const PointArray<Scalar> liquid = neighbor_cases<Scalar>()[2].position;
  compare("rebuild forgets: fewer particles", liquid.leftCols(37), 1);
  compare("rebuild forgets: a smaller radius", liquid, Scalar(0.6));
  compare("scale does not matter", liquid * Scalar(1e-3), Scalar(1e-3));

  search.rebuild(liquid, 1, Threads{1});
  std::vector<Found> one_thread;
  for (Index i = 0; i < liquid.cols(); ++i) {
    one_thread.push_back(neighbors(search, i));
  }
  for (const int threads : {2, 4}) {
    search.rebuild(liquid, 1, Threads{threads});
    double wrong = 0;
    for (Index i = 0; i < liquid.cols(); ++i) {
      wrong += neighbors(search, i) == one_thread[static_cast<std::size_t>(i)] ? 0 : 1;
    }
    laws.push_back({"the same sequence with 1 and " + std::to_string(threads) + " threads", wrong, 0});
  }

  for (const Scalar radius :
       {Scalar(0), Scalar(-1), std::numeric_limits<Scalar>::quiet_NaN(), std::numeric_limits<Scalar>::infinity()}) {
    double wrong = 1;
    try {
      search.rebuild(liquid, radius, Threads{1});
    } catch (const std::invalid_argument&) {
      wrong = 0;
    }
    laws.push_back({"rebuild refuses a support radius of " + std::to_string(radius), wrong, 0});
  }
  return laws;
}

}  // namespace decant::inline DECANT_TARGET::testing
