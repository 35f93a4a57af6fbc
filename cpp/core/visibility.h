// Which points Eq. 4 and 6 compare: found by the caller at some estimate, held during an evaluation.
#ifndef SPBA_CORE_VISIBILITY_H_
#define SPBA_CORE_VISIBILITY_H_

#include <cstdint>
#include <vector>

#include "spba/inverse_depth.h"

namespace spba {

// A list for each of N points, one after another.
template <typename Item>
class PointLists {
 public:
  PointLists() = default;
  // `item(i)` of the point `of_point(i)`, i < count. Items of one point keep their order.
  template <typename OfPoint, typename MakeItem>
  PointLists(int points, size_t count, const OfPoint& of_point, const MakeItem& item)
      : first_(static_cast<size_t>(points) + 1, 0), items_(count) {
    for (size_t i = 0; i < count; ++i) ++first_[static_cast<size_t>(of_point(i)) + 1];
    for (size_t j = 1; j < first_.size(); ++j) first_[j] += first_[j - 1];
    std::vector<uint32_t> next(first_.begin(), first_.end() - 1);
    for (size_t i = 0; i < count; ++i) items_[next[static_cast<size_t>(of_point(i))]++] = item(i);
  }

  bool empty() const { return items_.empty(); }
  const Item* begin(int j) const { return items_.data() + first_[static_cast<size_t>(j)]; }
  const Item* end(int j) const { return items_.data() + first_[static_cast<size_t>(j) + 1]; }

 private:
  std::vector<uint32_t> first_;  // point -> its first item; one more at the end
  std::vector<Item> items_;
};

// A point compared between the two frames of a pair.
struct Comparison {
  uint32_t pair;
  // In how many of Eq. 4's two sums it is: they have the same residual, up to its sign.
  uint8_t directions;
};

// Off-the-shelf inverse depth where a frame sees a point.
struct SeenDepth {
  uint32_t frame;
  InverseDepthError error;
  // Against one that is exact.
  double weight;
};

struct Visibility {
  // Of the images.
  int level = 0;
  struct Pair {
    uint32_t a, b;
    // What the pair's share of Eq. 4 weighs.
    double weight;
  };
  std::vector<Pair> pairs;
  PointLists<Comparison> comparisons;
  PointLists<SeenDepth> depths;
  // What a point's way to the silhouettes' pixels weighs, for the first so many points; 1 for the others.
  std::vector<double> silhouette_weights;

  double SilhouetteWeight(int j) const {
    return static_cast<size_t>(j) < silhouette_weights.size() ? silhouette_weights[static_cast<size_t>(j)]
                                                              : 1.0;
  }
};

}  // namespace spba

#endif  // SPBA_CORE_VISIBILITY_H_
