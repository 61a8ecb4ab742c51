#include "stages/group_classes/find_ambiguous.h"

#include <algorithm>
#include <cmath>

#include "core/descriptor_distance.h"
#include "core/descriptor_matcher.h"
#include "core/feature_class.h"

namespace cairn {
namespace {

constexpr int kSmallRange = 64;

struct Nearest {
  int32_t idx = -1;
  int32_t dot_product = -1;
};

void Offer(Nearest* nearest, int32_t idx, int32_t dot_product) {
  if (idx < 0) return;
  if (dot_product > nearest->dot_product || (dot_product == nearest->dot_product && idx < nearest->idx)) {
    *nearest = {idx, dot_product};
  }
}

// Nearest other class of each in [begin, end): the range's halves against each other, then each half by
// itself.  Every pair is looked at once.
void FindNearest(const DescriptorMatrix& centres, int begin, int end, std::vector<Nearest>* nearest) {
  if (end - begin <= kSmallRange) {
    for (int i = begin; i < end; ++i) {
      for (int j = i + 1; j < end; ++j) {
        const int32_t dot = DescriptorDot(centres.row(i).data(), centres.row(j).data());
        Offer(&(*nearest)[i], j, dot);
        Offer(&(*nearest)[j], i, dot);
      }
    }
    return;
  }
  const int middle = (begin + end) / 2;
  std::vector<BestTwo> rows, columns;
  FindBestTwo(centres.middleRows(begin, middle - begin), centres.middleRows(middle, end - middle),
              FastestKernel(), &rows, &columns);
  for (int i = begin; i < middle; ++i)
    Offer(&(*nearest)[i], middle + rows[i - begin].idx, rows[i - begin].best);
  for (int i = middle; i < end; ++i)
    Offer(&(*nearest)[i], begin + columns[i - middle].idx, columns[i - middle].best);
  FindNearest(centres, begin, middle, nearest);
  FindNearest(centres, middle, end, nearest);
}

}  // namespace

void DescribeClass(const std::vector<const uint8_t*>& descriptors, ClassAppearance* appearance) {
  DescriptorSum sum = DescriptorSum::Zero();
  for (const uint8_t* descriptor : descriptors) {
    sum += Eigen::Map<const Eigen::Matrix<uint8_t, 1, kDescriptorDim>>(descriptor).cast<double>();
  }
  appearance->centre = MeanDescriptor(sum);
  double squared_sum = 0;
  for (const uint8_t* descriptor : descriptors) {
    const double angle = DescriptorAngleRad(DescriptorDot(descriptor, appearance->centre.data()));
    squared_sum += angle * angle;
  }
  appearance->radius_rad =
      std::sqrt(squared_sum / static_cast<double>(std::max<size_t>(1, descriptors.size())));
}

std::vector<Ambiguity> FindAmbiguous(const std::vector<ClassAppearance>& classes,
                                     const FindAmbiguousOptions& options) {
  const int num_classes = static_cast<int>(classes.size());
  DescriptorMatrix centres(num_classes, kDescriptorDim);
  for (int i = 0; i < num_classes; ++i) centres.row(i) = classes[i].centre;
  std::vector<Nearest> nearest(num_classes);
  FindNearest(centres, 0, num_classes, &nearest);

  std::vector<Ambiguity> ambiguity(num_classes, Ambiguity::kNone);
  const auto mark = [&](int i, Ambiguity value) {
    if (ambiguity[i] == Ambiguity::kNone) ambiguity[i] = value;
  };
  for (int i = 0; i < num_classes; ++i) {
    const int j = nearest[i].idx;
    if (j < 0) continue;
    const double radius = std::max(classes[i].radius_rad, classes[j].radius_rad);
    if (DescriptorAngleRad(nearest[i].dot_product) > options.min_separation_ratio * radius) continue;
    if ((classes[i].position - classes[j].position).norm() <= options.max_duplicate_distance_m) {
      const bool i_stays = classes[i].num_observations > classes[j].num_observations ||
                           (classes[i].num_observations == classes[j].num_observations && i < j);
      mark(i_stays ? j : i, Ambiguity::kDuplicate);
    } else {
      mark(i, Ambiguity::kAmbiguous);
      mark(j, Ambiguity::kAmbiguous);
    }
  }
  return ambiguity;
}

}  // namespace cairn
