#include "stages/group_classes/find_ambiguous.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <tuple>

#include "core/base/pooled.h"
#include "core/features/descriptor_distance.h"
#include "core/features/descriptor_matcher.h"
#include "core/world/feature_class.h"

namespace cairn::group_classes {
namespace {

// Sets of fewer pairs than this are compared one by one.
constexpr size_t kFewPairs = 64 * 64;

// The smallest dot product of two centres that lie within `angle_rad` of each other.
int32_t LeastDot(double angle_rad, const DescriptorSpace& space) {
  int32_t low = 0, high = static_cast<int32_t>(space.squared_norm);
  while (low < high) {
    const int32_t middle = (low + high) / 2;
    if (DescriptorAngleRad(middle, space) <= angle_rad) {
      high = middle;
    } else {
      low = middle + 1;
    }
  }
  return space.is_sift() ? low : std::max(low, 1);  // of others, what is at a right angle does not count
}

// All pairs of classes of which one lies within the other's radius.  Classes are compared in the order of
// their radii, the widest first: for any two the first one's radius then decides, and a row's largest dot
// product with a set of later columns shows whether the set has a look-alike of the row.
class LookAlikeSearch {
 public:
  LookAlikeSearch(const std::vector<ClassAppearance>& classes, const DescriptorSpace& space, double ratio)
      : space_(space),
        centres_(classes.size(), space.num_values),
        order_(classes.size()),
        least_dots_(classes.size()) {
    std::iota(order_.begin(), order_.end(), 0);
    std::sort(order_.begin(), order_.end(), [&](int a, int b) {
      return std::tie(classes[b].radius_rad, a) < std::tie(classes[a].radius_rad, b);
    });
    for (size_t i = 0; i < order_.size(); ++i) {
      centres_.row(static_cast<int>(i)) = classes[order_[i]].centre;
      least_dots_[i] = LeastDot(ratio * classes[order_[i]].radius_rad, space);
    }
  }

  // Calls visit(i, k) for each pair once, in no particular order.
  template <typename Visit>
  void ForEachPair(const Visit& visit) const {
    std::vector<int> ranks(order_.size());
    std::iota(ranks.begin(), ranks.end(), 0);
    Within(ranks.data(), ranks.data() + ranks.size(), visit);
  }

 private:
  // Pairs of ascending ranks: the halves against each other, then each half by itself.
  template <typename Visit>
  void Within(const int* begin, const int* end, const Visit& visit) const {
    if (end - begin < 2) return;
    const int* const middle = begin + (end - begin) / 2;
    Between({begin, middle}, {middle, end}, visit);
    Within(begin, middle, visit);
    Within(middle, end, visit);
  }

  // Pairs of a row and a column.  REQUIRES: both ascending, all rows before all columns
  template <typename Visit>
  void Between(const std::vector<int>& rows, const std::vector<int>& columns, const Visit& visit) const {
    if (rows.size() * columns.size() <= kFewPairs) {
      for (const int row : rows) {
        for (const int column : columns) {
          const int32_t dot = DescriptorDot(centres_.row(row).data(), centres_.row(column).data(), space_);
          if (dot >= least_dots_[row]) visit(order_[row], order_[column]);
        }
      }
      return;
    }
    PooledVector<BestTwo> row_bests, column_bests;
    FindBestTwo(Centres(rows), Centres(columns), space_, FastestKernel(), &row_bests, &column_bests);
    // Rows with one look-alike are done; those with more are searched again, with the columns that may
    // be look-alikes.
    std::vector<int> other_rows, other_columns;
    for (size_t i = 0; i < rows.size(); ++i) {
      const int32_t least_dot = least_dots_[rows[i]];
      if (row_bests[i].second >= least_dot) {
        other_rows.push_back(rows[i]);
      } else if (row_bests[i].best >= least_dot) {
        visit(order_[rows[i]], order_[columns[row_bests[i].idx]]);
      }
    }
    if (other_rows.empty()) return;
    for (size_t k = 0; k < columns.size(); ++k) {
      if (column_bests[k].best >= least_dots_[other_rows[0]]) other_columns.push_back(columns[k]);
    }
    const bool halve_rows = other_rows.size() > other_columns.size();
    const std::vector<int>& halved = halve_rows ? other_rows : other_columns;
    const auto middle = halved.begin() + static_cast<std::ptrdiff_t>(halved.size() / 2);
    for (const std::vector<int>& half : {std::vector<int>(halved.begin(), middle), {middle, halved.end()}}) {
      Between(halve_rows ? half : other_rows, halve_rows ? other_columns : half, visit);
    }
  }

  DescriptorMatrix Centres(const std::vector<int>& ranks) const {
    DescriptorMatrix centres(ranks.size(), space_.num_values);
    for (size_t i = 0; i < ranks.size(); ++i) centres.row(static_cast<int>(i)) = centres_.row(ranks[i]);
    return centres;
  }

  DescriptorSpace space_;
  DescriptorMatrix centres_;         // by rank: the widest class first
  std::vector<int> order_;           // class of each rank
  std::vector<int32_t> least_dots_;  // by rank, ascending: with it or more, a later class is a look-alike
};

}  // namespace

void DescribeClass(const std::vector<const uint8_t*>& descriptors, const DescriptorSpace& space,
                   ClassAppearance* appearance) {
  Eigen::Matrix<double, 1, Eigen::Dynamic> sum =
      Eigen::Matrix<double, 1, Eigen::Dynamic>::Zero(space.num_values);
  for (const uint8_t* descriptor : descriptors) {
    sum += Eigen::Map<const DescriptorRow>(descriptor, space.num_values).cast<double>();
  }
  appearance->centre = MeanDescriptor(sum, static_cast<int64_t>(descriptors.size()), space);
  double squared_sum = 0;
  for (const uint8_t* descriptor : descriptors) {
    const double angle =
        DescriptorAngleRad(DescriptorDot(descriptor, appearance->centre.data(), space), space);
    squared_sum += angle * angle;
  }
  // [Sala06 §VI-B] "the radius of the classes in the feature space": root mean square about the centre
  appearance->radius_rad =
      std::sqrt(squared_sum / static_cast<double>(std::max<size_t>(1, descriptors.size())));
}

std::vector<Ambiguity> FindAmbiguous(const std::vector<ClassAppearance>& classes,
                                     const DescriptorSpace& space, const FindAmbiguousOptions& options) {
  std::vector<Ambiguity> ambiguity(classes.size(), Ambiguity::kNone);
  if (options.min_separation_ratio <= 0) return ambiguity;
  // [Sala06 §VI-B] where the distance is "not significantly larger than the radius", both classes go
  LookAlikeSearch(classes, space, options.min_separation_ratio).ForEachPair([&](int i, int k) {
    if ((classes[i].position - classes[k].position).norm() > options.max_duplicate_distance_m) {
      ambiguity[i] = ambiguity[k] = Ambiguity::kAmbiguous;
      return;
    }
    const bool i_stays = std::tie(classes[k].num_observations, i) < std::tie(classes[i].num_observations, k);
    Ambiguity& other = ambiguity[i_stays ? k : i];
    if (other == Ambiguity::kNone) other = Ambiguity::kDuplicate;
  });
  return ambiguity;
}

}  // namespace cairn::group_classes
