// SPDX-License-Identifier: MIT
#include <decant/neighbor/neighbor_list.hpp>

#include <algorithm>
#include <atomic>
#include <random>
#include <vector>

#include <decant/neighbor/brute_force.hpp>
#include <decant/testing/neighbor.hpp>

#include "catch.hpp"

namespace {

using decant::Batch;
using decant::BruteForce;
using decant::CellGrid;
using decant::Index;
using decant::NeighborList;
using decant::OpenDomain;
using decant::PeriodicDomain;
using decant::PointArray;
using decant::Threads;
using decant::Vector3;

template <class List>
std::vector<Index> row_of(const List& list, Index i) {
  std::vector<Index> row;
  for (std::size_t k = 0; k < list.count(i); ++k) {
    row.push_back(static_cast<Index>(list.index()[list.first(i) + k]));
  }
  return row;
}

// Everything that holds for a list whatever was put into it.
template <class List>
void check_form(const List& list) {
  using Scalar = typename List::Scalar;
  constexpr std::size_t width = Batch<Scalar>::width;
  bool rows_fit = true, ascending = true, padded = true, batches_agree = true;
  std::size_t pairs = 0;
  for (Index i = 0; i < list.size(); ++i) {
    const std::vector<Index> row = row_of(list, i);
    pairs += row.size();
    ascending = ascending && std::is_sorted(row.begin(), row.end());
    rows_fit = rows_fit && list.first(i) % 16 == 0 && list.padded_end(i) <= list.index_size() &&
               list.padded_end(i) == list.first(i) + (row.size() + width - 1) / width * width;
    for (std::size_t k = list.first(i) + row.size(); k < list.padded_end(i); ++k) {
      padded = padded && list.index()[k] == static_cast<std::uint32_t>(i);
    }
    std::size_t next = 0;
    std::vector<Vector3<Scalar>> between;
    std::vector<Scalar> squared;
    list.for_each(i, [&](Index j, const Vector3<Scalar>& x_ij, Scalar r_squared) {
      rows_fit = rows_fit && next < row.size() && row[next] == j;
      ++next;
      between.push_back(x_ij);
      squared.push_back(r_squared);
    });
    rows_fit = rows_fit && next == row.size();
    next = 0;
    list.for_each_batch(i, [&](const typename List::Pairs& batch) {
      batches_agree = batches_agree && batch.slot == list.first(i) + next &&
                      batch.neighbor == list.index() + batch.slot && (next == 0 || next < row.size());
      for (int lane = 0; lane < static_cast<int>(width); ++lane, ++next) {
        const bool valid = next < row.size();
        const Vector3<Scalar> expected = valid ? between[next] : Vector3<Scalar>(Vector3<Scalar>::Zero());
        batches_agree = batches_agree && batch.valid[lane] == valid && batch.x[lane] == expected[0] &&
                        batch.y[lane] == expected[1] && batch.z[lane] == expected[2] &&
                        batch.distance_squared[lane] == (valid ? squared[next] : Scalar(0));
      }
    });
    batches_agree = batches_agree && next == (row.size() + width - 1) / width * width;
  }
  CHECK(ascending);
  CHECK(rows_fit);
  CHECK(padded);
  CHECK(batches_agree);
  CHECK(pairs == list.pairs());
}

template <class Scalar, class Domain>
void compare_with_brute_force(const PointArray<Scalar>& position, Scalar radius, const Domain& domain) {
  BruteForce<Scalar, Domain> reference(domain);
  CellGrid<Scalar, Domain> grid(domain);
  NeighborList<Scalar, Domain> expected(domain), list(domain);
  expected.build(reference, position, radius, Threads{1});
  check_form(expected);
  for (const int threads : {1, 2, 4}) {
    list.build(grid, position, radius, Threads{threads});
    check_form(list);
    bool same = list.size() == position.cols();
    for (Index i = 0; i < position.cols(); ++i) {
      std::vector<Index> row;
      reference.for_each(i, [&row](Index j, Scalar) { row.push_back(j); });
      same = same && row_of(list, i) == row && row_of(expected, i) == row;
    }
    CHECK(same);
  }

  // The same particles in the grid's order: no row has to be sorted then, another path.
  PointArray<Scalar> sorted(3, position.cols());
  for (Index k = 0; k < position.cols(); ++k) {
    sorted.col(k) = position.col(grid.order()[static_cast<std::size_t>(k)]);
  }
  grid.adopt_order(Threads{2});
  list.build_from(grid, sorted, Threads{2});
  check_form(list);
  reference.rebuild(sorted, radius);
  bool same = true;
  for (Index i = 0; i < sorted.cols(); ++i) {
    std::vector<Index> row;
    reference.for_each(i, [&row](Index j, Scalar) { row.push_back(j); });
    same = same && row_of(list, i) == row;
  }
  CHECK(same);
}

}  // namespace

TEMPLATE_TEST_CASE("NeighborList holds what brute force finds", "", float, double) {
  for (const auto& item : decant::testing::neighbor_cases<TestType>()) {
    INFO(item.name);
    compare_with_brute_force<TestType>(item.position, 1, OpenDomain{});
  }
}

TEMPLATE_TEST_CASE("NeighborList holds what brute force finds in periodic domains", "", float, double) {
  const auto cases = decant::testing::neighbor_cases<TestType>();
  for (const Vector3<TestType>& period :
       {Vector3<TestType>(2, 2, 2), Vector3<TestType>(3, 0, 5), Vector3<TestType>(0, 40, 7)}) {
    for (const std::size_t k : {0u, 1u, 2u, 3u, 4u, 5u, 7u, 10u}) {
      INFO(cases[k].name);
      compare_with_brute_force<TestType>(cases[k].position, 1, PeriodicDomain<TestType>(period));
    }
  }
}

TEST_CASE("NeighborList grows when rows get longer than ever before") {
  // 600 particles in one place: rows of 599, where a liquid has 30; more than one chunk of rows.
  const PointArray<float> position = PointArray<float>::Zero(3, 600);
  CellGrid<float> grid;
  NeighborList<float> list;
  list.build(grid, position, 1.0f, Threads{2});
  check_form(list);
  CHECK(list.pairs() == 600 * 599);
  BruteForce<float> search;
  NeighborList<float> other;
  other.build(search, position, 1.0f, Threads{2});
  check_form(other);
  CHECK(other.pairs() == 600 * 599);
}

TEST_CASE("NeighborList of several chunks is the same for any number of threads") {
  std::mt19937 generator(5);
  PointArray<float> position(3, 5000);
  for (Index k = 0; k < position.size(); ++k) {
    position.data()[k] = static_cast<float>(generator()) * (8.5f / 4294967296.0f);
  }
  CellGrid<float> grid;
  NeighborList<float> one;
  one.build(grid, position, 1.0f, Threads{1});
  BruteForce<float> reference;
  NeighborList<float> expected;
  expected.build(reference, position, 1.0f, Threads{2});
  for (const int threads : {1, 2, 3, 4, 16}) {
    NeighborList<float> list;
    list.build(grid, position, 1.0f, Threads{threads});
    bool same = true;
    for (Index i = 0; i < position.cols(); ++i) {
      same = same && list.first(i) == one.first(i) && row_of(list, i) == row_of(one, i) &&
             row_of(list, i) == row_of(expected, i);
    }
    CHECK(same);
  }
}

TEMPLATE_TEST_CASE("NeighborList strikes out pairs and fills up the rows", "", float, double) {
  const PointArray<TestType> position = decant::testing::neighbor_cases<TestType>()[2].position;
  CellGrid<TestType> grid;
  NeighborList<TestType> list;
  list.build(grid, position, 1);
  const std::size_t before = list.pairs();
  std::vector<std::vector<Index>> expected;
  constexpr Index spared = 12;
  const auto apart = [](Index i, Index j) { return (i + j) % 3 == 0 || i == 7 || j == 7; };
  for (Index i = 0; i < list.size(); ++i) {
    expected.emplace_back();
    for (const Index j : row_of(list, i)) {
      if (i == spared || !apart(i, j)) {
        expected.back().push_back(j);
      }
    }
  }
  REQUIRE(list.count(spared) > 0);
  std::atomic<int> wrong{0};
  list.remove_if([](Index i) { return i != spared; },
                 [&](Index i, Index j, const decant::Vector3<TestType>& between) {
                   wrong += between == position.col(i) - position.col(j) ? 0 : 1;
                   return apart(i, j);
                 },
                 Threads{2});
  CHECK(wrong == 0);
  check_form(list);
  CHECK(list.pairs() < before);
  CHECK(list.count(7) == 0);
  for (Index i = 0; i < list.size(); ++i) {
    CHECK(row_of(list, i) == expected[static_cast<std::size_t>(i)]);
  }
}

TEST_CASE("NeighborList keeps its own copy of the positions and can be copied") {
  PointArray<double> position = decant::testing::neighbor_cases<double>()[2].position;
  NeighborList<double> copied;
  std::vector<Index> row;
  {
    CellGrid<double> grid;
    NeighborList<double> list;
    list.build(grid, position, 1.0);
    row = row_of(list, 5);
    copied = list;
    CellGrid<double> other = grid;
    grid.rebuild(position, 0.1);
    NeighborList<double> again;
    again.build_from(other, position);
    CHECK(row_of(again, 5) == row);
  }
  const Vector3<double> first = position.col(5) - position.col(row[0]);
  position.setZero();
  CHECK(row_of(copied, 5) == row);
  bool checked = false;
  copied.for_each(5, [&](Index, const Vector3<double>& x_ij, double) {
    CHECK((checked || x_ij == first));
    checked = true;
  });
  CHECK(checked);
}

TEST_CASE("NeighborList refuses positions that the search was not built for") {
  CellGrid<float> grid;
  NeighborList<float> list;
  const PointArray<float> position = PointArray<float>::Zero(3, 4);
  grid.rebuild(position, 1.0f);
  CHECK_THROWS_WITH(list.build_from(grid, position.leftCols(3)),
                    decant_test::contains("NeighborList: number of positions must be that of the search"));
  CHECK_THROWS_WITH(list.build(grid, position, -1.0f), decant_test::contains("support_radius [m] must be > 0"));
}
