// SPDX-License-Identifier: MIT
#pragma once

/// Neighbours from a k-d tree (nanoflann 1.4 or later): the only header that includes nanoflann, and not part of
/// decant.hpp.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <vector>

#include <nanoflann.hpp>

#include <decant/core/batch.hpp>
#include <decant/core/domain.hpp>
#include <decant/core/target.hpp>
#include <decant/neighbor/concept.hpp>

namespace decant::inline DECANT_TARGET {

/// A balanced tree over the particles, for clouds whose density varies over orders of magnitude; for liquids CellGrid
/// is about ten times faster. Each rebuild allocates and runs on one thread. Copies share the tree, which never
/// changes.
template <std::floating_point ScalarType, class DomainType = OpenDomain>
class KdTree {
 public:
  using Scalar = ScalarType;
  using Domain = DomainType;

  explicit KdTree(Domain domain = {}) : domain_(domain) {}

  void rebuild(const ConstPointsView<Scalar>& position, Scalar support_radius, Threads = {}) {
    detail::check_search(domain_, position.cols(), support_radius);
    tree_.reset();
    tree_ = std::make_shared<const Tree>(domain_, position);
    support_radius_ = support_radius;
  }

  Index size() const noexcept { return tree_ ? tree_->cloud.position.cols() : 0; }
  const Domain& domain() const noexcept { return domain_; }

  template <class Function>
  void for_each(Index i, Function&& f) const noexcept {
    const Cloud& cloud = tree_->cloud;
    const Vector3<Scalar> own = cloud.position.col(i);
    if (!own.allFinite()) {
      return;
    }
    // The tree rounds differently from squared_length, so it looks a little farther and each find is measured again.
    const Scalar reach = support_radius_ * (1 + 64 * epsilon) + cloud.wrap_error;
    const auto search_image = [&](const Vector3<Scalar>& image) {
      Finder<Function> finder{*this, i, own, image, reach * reach, f};
      tree_->index.findNeighbors(finder, image.data(), exact());
    };
    if constexpr (!Domain::periodic) {
      search_image(own);
    } else {
      const Vector3<Scalar> wrapped = domain_.wrap(own);
      std::array<std::array<Scalar, 3>, 3> shifts{};  // per axis, 0 first
      std::array<std::size_t, 3> count{1, 1, 1};
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const Scalar period = domain_.period()[static_cast<Index>(axis)];
        const Scalar at = wrapped[static_cast<Index>(axis)];
        if (period > 0 && at < reach) {
          shifts[axis][count[axis]++] = period;
        }
        if (period > 0 && at > period - reach) {
          shifts[axis][count[axis]++] = -period;
        }
      }
      for (std::size_t a = 0; a < count[0]; ++a) {
        for (std::size_t b = 0; b < count[1]; ++b) {
          for (std::size_t c = 0; c < count[2]; ++c) {
            search_image(wrapped + Vector3<Scalar>(shifts[0][a], shifts[1][b], shifts[2][c]));
          }
        }
      }
    }
  }

 private:
  static constexpr Scalar epsilon = std::numeric_limits<Scalar>::epsilon();

  // What nanoflann reads: the particles that have a place.
  struct Cloud {
    PointArray<Scalar> position;  // all, as given
    PointArray<Scalar> placed;    // wrapped
    std::vector<std::uint32_t> number;
    Scalar wrap_error = 0;  // bound of |placed - image of position|

    Cloud(const Domain& domain, const ConstPointsView<Scalar>& given) : position(given), placed(3, given.cols()) {
      number.reserve(static_cast<std::size_t>(given.cols()));
      for (Index i = 0; i < given.cols(); ++i) {
        if (given.col(i).allFinite()) {
          placed.col(static_cast<Index>(number.size())) = domain.wrap(Vector3<Scalar>(given.col(i)));
          number.push_back(static_cast<std::uint32_t>(i));
          if constexpr (Domain::periodic) {
            wrap_error = std::max(wrap_error, 8 * epsilon * (given.col(i).cwiseAbs() + domain.period()).maxCoeff());
          }
        }
      }
    }
    std::size_t kdtree_get_point_count() const { return number.size(); }
    Scalar kdtree_get_pt(std::size_t k, std::size_t axis) const {
      return placed(static_cast<Index>(axis), static_cast<Index>(k));
    }
    template <class Box>
    bool kdtree_get_bbox(Box&) const {
      return false;
    }
  };

  // Takes the place of a list of results, so that a query allocates nothing.
  template <class Function>
  struct Finder {
    using DistanceType = Scalar;
    const KdTree& search;
    const Index self;
    const Vector3<Scalar>& own;
    const Vector3<Scalar>& image;
    const Scalar reach_squared;
    Function& f;

    Scalar worstDist() const { return reach_squared; }
    bool full() const { return true; }
    bool empty() const { return false; }
    std::size_t size() const { return 0; }
    void sort() const {}
    bool addPoint(Scalar, std::size_t k) {
      const Cloud& cloud = search.tree_->cloud;
      const auto j = static_cast<Index>(cloud.number[k]);
      std::array<Scalar, 3> between;
      bool nearest_image = true;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const auto row = static_cast<Index>(axis);
        between[axis] = search.domain_.separation(static_cast<int>(axis), own[row], cloud.position(row, j));
        if constexpr (Domain::periodic) {
          // In a box of two support radii, a particle can be in reach through both ends: count it once.
          const Scalar period = search.domain_.period()[row];
          const Scalar through_image = image[row] - cloud.placed(row, static_cast<Index>(k));
          nearest_image = nearest_image && (period == 0 || absolute(through_image - between[axis]) < period / 2);
        }
      }
      const Scalar r_squared = squared_length(between[0], between[1], between[2]);
      if (j != self && nearest_image && r_squared < search.support_radius_ * search.support_radius_) {
        f(j, r_squared);
      }
      return true;  // go on searching
    }
  };

  static auto exact() {
#if NANOFLANN_VERSION >= 0x150
    return nanoflann::SearchParameters(0, false);
#else
    return nanoflann::SearchParams(0, 0, false);
#endif
  }

  struct Tree {
    using Index3 =
        nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<Scalar, Cloud>, Cloud, 3, std::size_t>;
    Cloud cloud;
    Index3 index;

    Tree(const Domain& domain, const ConstPointsView<Scalar>& position) : cloud(domain, position), index(3, cloud) {}
    Tree(const Tree&) = delete;  // the index refers to the cloud
    Tree& operator=(const Tree&) = delete;
  };

  Domain domain_;
  Scalar support_radius_ = 0;
  std::shared_ptr<const Tree> tree_;
};

static_assert(NeighborSearch<KdTree<float>> && NeighborSearch<KdTree<double, PeriodicDomain<double>>>);

}  // namespace decant::inline DECANT_TARGET
