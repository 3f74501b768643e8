// SPDX-License-Identifier: MIT
#include <decant/testing/neighbor.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include <decant/neighbor/brute_force.hpp>
#include <decant/neighbor/cell_grid.hpp>
#if __has_include(<nanoflann.hpp>)
#include <decant/neighbor/kd_tree.hpp>
#endif

#include "catch.hpp"

namespace {

using decant::BruteForce;
using decant::CellGrid;
using decant::Index;
using decant::PeriodicDomain;
using decant::PointArray;
using decant::Threads;
using decant::Vector3;

template <class Search>
void check_laws(const Search& search) {
  for (const decant::testing::Law& law : decant::testing::neighbor_laws(search)) {
    INFO(law.text());
    CHECK(law.holds());
  }
}

template <template <class, class> class Search, class Scalar>
void check_laws_in_all_domains() {
  check_laws(Search<Scalar, decant::OpenDomain>());
  // 2 support radii: a particle sees its neighbour through both ends; 3.5: few cells; 60: many cells, one axis open
  for (const Vector3<Scalar>& period :
       {Vector3<Scalar>(2, 2, 2), Vector3<Scalar>(Scalar(3.5), 0, 5), Vector3<Scalar>(7, 60, 0)}) {
    check_laws(Search<Scalar, PeriodicDomain<Scalar>>(PeriodicDomain<Scalar>(period)));
  }
}

// What the laws have to notice.
template <int Fault>
struct Faulty : BruteForce<float> {
  void rebuild(const decant::ConstPointsView<float>& position, float radius, Threads threads = {}) {
    threads_ = threads.count;
    BruteForce<float>::rebuild(position, Fault == 6 ? std::abs(radius) : Fault == 7 ? 1.0f : radius, threads);
  }
  template <class Function>
  void for_each(Index i, Function&& f) const noexcept {
    Index last = -1;
    BruteForce<float>::for_each(i, [&](Index j, float r_squared) {
      if (!(Fault == 1 && r_squared > 0.999f) && !(Fault == 2 && r_squared == 0) &&
          !(Fault == 5 && threads_ == 4 && i == 9)) {
        f(j, Fault == 3 ? r_squared * 1.000001f : r_squared);
      }
      last = j;
    });
    if (Fault == 4 && last >= 0) {
      f(last, 0.5f);  // twice
    }
  }
  int threads_ = 0;
};

template <int Fault>
bool noticed() {
  const auto laws = decant::testing::neighbor_laws(Faulty<Fault>());
  return !std::all_of(laws.begin(), laws.end(), [](const auto& law) { return law.holds(); });
}

}  // namespace

TEST_CASE("The laws of neighbour searches notice faults") {
  CHECK_FALSE(noticed<0>());
  CHECK(noticed<1>());
  CHECK(noticed<2>());
  CHECK(noticed<3>());
  CHECK(noticed<4>());
  CHECK(noticed<5>());
  CHECK(noticed<6>());
  CHECK(noticed<7>());
}

TEMPLATE_TEST_CASE("CellGrid finds what brute force finds", "", float, double) {
  check_laws_in_all_domains<CellGrid, TestType>();
}

#if __has_include(<nanoflann.hpp>)
TEMPLATE_TEST_CASE("KdTree finds what brute force finds", "", float, double) {
  check_laws_in_all_domains<decant::KdTree, TestType>();
}
#endif

TEST_CASE("Brute force finds the neighbours that one can count") {
  PointArray<double> position(3, 4);
  position << 0, 1, 0, 3,  //
      0, 0, 0.5, 0,        //
      0, 0, 0, 0;
  BruteForce<double> search;
  search.rebuild(position, 1.1);
  std::vector<std::pair<Index, double>> found;
  search.for_each(0, [&found](Index j, double r_squared) { found.emplace_back(j, r_squared); });
  CHECK(found == std::vector<std::pair<Index, double>>{{1, 1.0}, {2, 0.25}});
  search.rebuild(position, 1.0);  // the support radius itself is outside
  found.clear();
  search.for_each(0, [&found](Index j, double r_squared) { found.emplace_back(j, r_squared); });
  CHECK(found == std::vector<std::pair<Index, double>>{{2, 0.25}});
  BruteForce<double, PeriodicDomain<double>> ring(PeriodicDomain<double>(Vector3<double>(3.2, 0, 0)));
  ring.rebuild(position, 1.0);
  found.clear();
  ring.for_each(0, [&found](Index j, double) { found.emplace_back(j, 0.0); });
  CHECK(found == std::vector<std::pair<Index, double>>{{2, 0.0}, {3, 0.0}});
  CHECK_THROWS_WITH(ring.rebuild(position, 1.7), decant_test::contains("period [m] must be 0 or at least twice"));
}

TEMPLATE_TEST_CASE("CellGrid sorts particles by place and adopts the order", "", float, double) {
  const PointArray<TestType> position = decant::testing::neighbor_cases<TestType>()[2].position;
  CellGrid<TestType> grid;
  grid.rebuild(position, 1);
  REQUIRE(grid.order().size() == 729);
  CHECK_FALSE(grid.in_order());
  PointArray<TestType> sorted(3, position.cols());
  std::vector<bool> seen(729, false);
  for (std::size_t k = 0; k < 729; ++k) {
    sorted.col(static_cast<Index>(k)) = position.col(grid.order()[k]);
    seen[grid.order()[k]] = true;
  }
  CHECK(std::all_of(seen.begin(), seen.end(), [](bool s) { return s; }));
  // Near in the array is near in space: a walk through a shuffled array would make steps of about 2.6.
  CHECK((sorted.rightCols(728) - sorted.leftCols(728)).colwise().norm().mean() < 1.3);

  grid.adopt_order();
  CHECK(grid.in_order());
  CellGrid<TestType> fresh;
  fresh.rebuild(sorted, 1);
  CHECK(fresh.in_order());
  for (Index i = 0; i < sorted.cols(); ++i) {
    std::vector<Index> adopted, rebuilt;
    grid.for_each(i, [&](Index j, TestType) { adopted.push_back(j); });
    fresh.for_each(i, [&](Index j, TestType) { rebuilt.push_back(j); });
    CHECK(adopted == rebuilt);
    CHECK(std::is_sorted(adopted.begin(), adopted.end()));
  }
}

TEMPLATE_TEST_CASE("CellGrid finds the particles near any point", "", float, double) {
  const PointArray<TestType> position = decant::testing::neighbor_cases<TestType>()[3].position;
  CellGrid<TestType> grid;
  grid.rebuild(position, 1);
  for (const TestType scale : {TestType(0.5), TestType(2.6), TestType(3.4), TestType(50), TestType(1e30)}) {
    for (int corner = 0; corner < 27; ++corner) {
      const Vector3<TestType> point =
          scale * Vector3<TestType>(TestType(corner % 3 - 1), TestType(corner / 3 % 3 - 1), TestType(corner / 9 - 1));
      Index found = 0;
      grid.for_each_near(point, [&](Index j, TestType r_squared) {
        ++found;
        CHECK(r_squared == Approx((position.col(j) - point).squaredNorm()));
      });
      CHECK(found == ((position.colwise() - point).colwise().norm().array() < 1).count());
    }
  }
  grid.for_each_near(Vector3<TestType>::Constant(std::numeric_limits<TestType>::quiet_NaN()),
                     [](Index, TestType) { FAIL("nothing is near NaN"); });
  CellGrid<TestType> unused;
  unused.for_each_near({0, 0, 0}, [](Index, TestType) { FAIL("an empty grid has no particles"); });
}

TEST_CASE("Rounding never puts neighbours two cells apart") {
  // Cell numbers are rounded twice as coarsely from 16384 on. Pairs just within the support radius, on both sides of
  // that number, come two cells apart if cells are no larger than the radius.
  const float step = 1.0f / 1024;  // between numbers of float from 8192 to 16384
  Index missed = 0;
  for (int steps = 700; steps < 740; ++steps) {
    const float radius = static_cast<float>(steps) * step * (1 + 3e-7f);
    PointArray<float> position = PointArray<float>::Zero(3, 21);
    for (Index k = 0; k < 10; ++k) {
      const float x = std::round(16384 * radius / step + static_cast<float>(k - 5)) * step;
      position(0, 2 * k + 1) = x;
      position(0, 2 * k + 2) = x + static_cast<float>(steps) * step;
    }
    CellGrid<float> grid;
    grid.rebuild(position, radius);
    for (Index i = 1; i < position.cols(); ++i) {
      const Index partner = ((i - 1) ^ 1) + 1;
      bool found = false;
      grid.for_each(i, [&](Index j, float) { found = found || j == partner; });
      missed += found ? 0 : 1;
    }
  }
  CHECK(missed == 0);
}

TEST_CASE("CellGrid reads positions with any stride and keeps nothing of them") {
  Eigen::Matrix<float, 4, Eigen::Dynamic> records = Eigen::Matrix<float, 4, Eigen::Dynamic>::Random(4, 300);
  CellGrid<float> strided, packed;
  strided.rebuild(records.topRows(3), 0.4f);
  PointArray<float> position = records.topRows(3);
  packed.rebuild(position, 0.4f);
  position.setZero();
  records.setZero();
  Index pairs = 0;
  for (Index i = 0; i < 300; ++i) {
    std::vector<Index> a, b;
    strided.for_each(i, [&](Index j, float) { a.push_back(j); });
    packed.for_each(i, [&](Index j, float) { b.push_back(j); });
    CHECK(a == b);
    pairs += static_cast<Index>(a.size());
  }
  CHECK(pairs > 300);
}
