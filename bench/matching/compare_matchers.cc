// Milliseconds and recall of descriptor matchers on the same descriptors, one core: all pairs of the images
// of a features.db.  All apply COLMAP's tests (ratio 0.8, angle 0.7 rad, each other's best, where the matcher
// has both directions); recall is the part found of what exact search finds, by an independent
// matrix product.
//
//   compare_matchers FEATURES.db COLMAP_MATCHES.db COLMAP_MS     prints rows of a Markdown table
//
// COLMAP_MATCHES.db: the same features, matched by COLMAP in COLMAP_MS a pair.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <ctime>
#include <functional>
#include <iterator>
#include <map>
#include <span>
#include <string>
#include <vector>

#include <opencv2/core/utility.hpp>
#include <opencv2/features2d.hpp>
#include <opencv2/flann.hpp>

#include "core/base/pooled.h"
#include "core/base/quantiles.h"
#include "core/colmap/colmap_database.h"
#include "core/features/descriptor_matcher.h"

namespace cairn {
namespace {

using Floats = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using FlannIndex = cv::flann::GenericIndex<cvflann::L2<uint8_t>>;
using Matches = PooledVector<Match>;

// As COLMAP builds and queries its trees.
constexpr int kNumFlannTrees = 4;
constexpr int kNumFlannChecks = 128;

struct Image {
  ImageId image_id = 0;
  DescriptorMatrix descriptors;
};
struct ImagePair {
  const Image* image1 = nullptr;
  const Image* image2 = nullptr;
  Matches exact;
};

double CpuMs() {
  timespec time;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return 1e3 * static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_nsec);
}

// COLMAP's tests of candidates (FindBestMatches in src/feature/matching.cc of 3.8).
Matches Select(std::span<const BestTwo> rows, std::span<const BestTwo> columns) {
  const auto angle = [](int dot) { return std::acos(std::min(dot / (512.0 * 512.0), 1.0)); };
  const auto passes = [&](const BestTwo& b) {
    return b.idx >= 0 && angle(b.best) <= 0.7 && (b.second < 0 || angle(b.best) < 0.8 * angle(b.second));
  };
  Matches matches;
  for (uint32_t row = 0; row < rows.size(); ++row) {
    if (!passes(rows[row])) continue;
    const BestTwo& column = columns[rows[row].idx];
    if (column.idx == static_cast<int>(row) && passes(column))
      matches.push_back({row, static_cast<uint32_t>(rows[row].idx)});
  }
  return matches;
}

// Products of floats are exact here: sums stay below 2^24.
Matches ExactMatches(const DescriptorMatrix& descriptors1, const DescriptorMatrix& descriptors2) {
  const Floats floats1 = descriptors1.cast<float>(), floats2 = descriptors2.cast<float>();
  PooledVector<BestTwo> rows(floats1.rows()), columns(floats2.rows());
  for (int begin = 0; begin < floats1.rows(); begin += 256) {
    const int num = std::min(256, static_cast<int>(floats1.rows()) - begin);
    const Floats dots = floats1.middleRows(begin, num) * floats2.transpose();
    for (int i = 0; i < num; ++i) {
      for (int j = 0; j < dots.cols(); ++j) {
        rows[begin + i].Offer(j, static_cast<int>(dots(i, j)));
        columns[j].Offer(begin + i, static_cast<int>(dots(i, j)));
      }
    }
  }
  return Select(rows, columns);
}

cv::Mat AsBytes(const DescriptorMatrix& descriptors) {
  return cv::Mat(static_cast<int>(descriptors.rows()), kSiftDescriptorDim, CV_8UC1,
                 const_cast<uint8_t*>(descriptors.data()));
}

cv::Mat AsFloats(const DescriptorMatrix& descriptors) {
  cv::Mat floats;
  AsBytes(descriptors).convertTo(floats, CV_32F);
  return floats;
}

// The better of the candidates of each query, by dot product as in COLMAP.
PooledVector<BestTwo> BestOf(const DescriptorMatrix& queries, const DescriptorMatrix& searched,
                             const std::function<int(int, int)>& candidate) {
  PooledVector<BestTwo> best(queries.rows());
  for (int i = 0; i < queries.rows(); ++i) {
    for (int k = 0; k < 2; ++k) {
      const int j = candidate(i, k);
      best[i].Offer(j, queries.row(i).cast<int>().dot(searched.row(j).cast<int>()));
    }
  }
  return best;
}

PooledVector<BestTwo> BruteForce(const DescriptorMatrix& queries, const DescriptorMatrix& searched) {
  std::vector<std::vector<cv::DMatch>> found;
  cv::BFMatcher(cv::NORM_L2).knnMatch(AsFloats(queries), AsFloats(searched), found, 2);
  return BestOf(queries, searched, [&](int i, int k) { return found[i][k].trainIdx; });
}

Matches BruteForceCrossCheck(const DescriptorMatrix& descriptors1, const DescriptorMatrix& descriptors2) {
  std::vector<cv::DMatch> found;
  cv::BFMatcher(cv::NORM_L2, /*crossCheck=*/true)
      .match(AsFloats(descriptors1), AsFloats(descriptors2), found);
  Matches matches;
  for (const cv::DMatch& match : found)
    matches.push_back({static_cast<uint32_t>(match.queryIdx), static_cast<uint32_t>(match.trainIdx)});
  std::sort(matches.begin(), matches.end());
  return matches;
}

PooledVector<BestTwo> SearchFlann(const DescriptorMatrix& queries, const DescriptorMatrix& searched,
                                  FlannIndex* index) {
  cv::Mat indices(static_cast<int>(queries.rows()), 2, CV_32S), distances(indices.size(), CV_32F);
  index->knnSearch(AsBytes(queries), indices, distances, 2, cvflann::SearchParams(kNumFlannChecks));
  return BestOf(queries, searched, [&](int i, int k) { return indices.at<int>(i, k); });
}

Result<std::vector<Image>> ReadImages(const std::string& path) {
  CAIRN_ASSIGN_OR_RETURN(SQLite::Database database, OpenColmapDatabase(path));
  return WithDatabaseErrors(path, [&]() -> Result<std::vector<Image>> {
    std::vector<Image> images;
    CAIRN_ASSIGN_OR_RETURN(const std::vector<DatabaseImage> rows, ReadDatabaseImages(database));
    for (const DatabaseImage& row : rows) {
      CAIRN_ASSIGN_OR_RETURN(DescriptorMatrix descriptors, ReadDatabaseDescriptors(database, row.image_id));
      images.push_back({row.image_id, std::move(descriptors)});
    }
    return images;
  });
}

// COLMAP's table of putative matches.
Result<std::map<int64_t, Matches>> ReadMatches(const std::string& path) {
  CAIRN_ASSIGN_OR_RETURN(SQLite::Database database, OpenColmapDatabase(path));
  return WithDatabaseErrors(path, [&]() -> Result<std::map<int64_t, Matches>> {
    std::map<int64_t, Matches> matches;
    SQLite::Statement query(database, "SELECT pair_id, data FROM matches WHERE data IS NOT NULL");
    while (query.executeStep()) {
      const SQLite::Column blob = query.getColumn(1);
      Matches& pair = matches[query.getColumn(0).getInt64()];
      pair.resize(blob.getBytes() / sizeof(Match));
      if (!pair.empty()) std::memcpy(pair.data(), blob.getBlob(), pair.size() * sizeof(Match));
      std::sort(pair.begin(), pair.end());
    }
    return matches;
  });
}

class Table {
 public:
  explicit Table(std::vector<ImagePair> pairs) : pairs_(std::move(pairs)) {
    double num_products = 0;
    for (const ImagePair& pair : pairs_) {
      num_products += static_cast<double>(pair.image1->descriptors.rows()) *
                      static_cast<double>(pair.image2->descriptors.rows());
    }
    giga_per_pair_ = 1e-9 * kSiftDescriptorDim * num_products / static_cast<double>(pairs_.size());
  }

  // Runs the matcher on each pair and adds its row.  Whether its matches are those of exact search.
  bool Run(const std::string& name, const std::function<Matches(const ImagePair&)>& matcher) {
    std::vector<double> ms;
    std::vector<Matches> found;
    matcher(pairs_.front());
    for (const ImagePair& pair : pairs_) {
      const double start = CpuMs();
      found.push_back(matcher(pair));
      ms.push_back(CpuMs() - start);
    }
    return Print(name, UpperMedian(ms), found);
  }

  bool Print(const std::string& name, double ms, const std::vector<Matches>& found) {
    if (fastest_ms_ == 0) fastest_ms_ = ms;
    size_t num_exact = 0, num_found = 0;
    bool is_exact = true;
    for (size_t i = 0; i < pairs_.size(); ++i) {
      Matches common;
      std::set_intersection(pairs_[i].exact.begin(), pairs_[i].exact.end(), found[i].begin(), found[i].end(),
                            std::back_inserter(common));
      num_exact += pairs_[i].exact.size();
      num_found += common.size();
      is_exact = is_exact && found[i] == pairs_[i].exact;
    }
    std::printf("| %s | %.2f | %.1f | %.1f | %.4f |\n", name.c_str(), ms, 1e3 * giga_per_pair_ / ms,
                ms / fastest_ms_, static_cast<double>(num_found) / static_cast<double>(num_exact));
    std::fflush(stdout);
    return is_exact;
  }

  const std::vector<ImagePair>& pairs() const { return pairs_; }

 private:
  std::vector<ImagePair> pairs_;
  double giga_per_pair_ = 0;  // multiply-adds of exact search
  double fastest_ms_ = 0;     // of the first row
};

std::vector<ImagePair> AllPairs(const std::vector<Image>& images) {
  std::vector<ImagePair> pairs;
  for (size_t i = 0; i < images.size(); ++i) {
    for (size_t j = i + 1; j < images.size(); ++j) {
      pairs.push_back({&images[i], &images[j], ExactMatches(images[i].descriptors, images[j].descriptors)});
    }
  }
  return pairs;
}

// One row per kernel that runs here, the fastest first.  False if one of them differs from exact search.
bool RunKernels(const std::vector<Image>& images, Table* table) {
  std::vector<MatchKernel> kernels(kMatchKernels.begin(), kMatchKernels.end());
  std::erase_if(kernels, [](MatchKernel kernel) { return !IsKernelSupported(kernel); });
  std::iter_swap(kernels.begin(), std::find(kernels.begin(), kernels.end(), FastestKernel()));
  bool is_exact = true;
  for (const MatchKernel kernel : kernels) {
    std::map<const Image*, PackedDescriptors> packed;
    const double start = CpuMs();
    for (const Image& image : images)
      packed.emplace(&image, PackedDescriptors(image.descriptors, {}, kernel));
    const double pack_ms = (CpuMs() - start) / static_cast<double>(images.size());
    const std::string name = fmt::format("cairn, {} (packing: {:.2f} ms an image)", NameOf(kernel), pack_ms);
    is_exact &= table->Run(name, [&](const ImagePair& pair) {
      return MatchDescriptors(packed.at(pair.image1), packed.at(pair.image2), {});
    });
  }
  return is_exact;
}

void RunPeers(const std::vector<Image>& images, Table* table) {
  table->Run("OpenCV BFMatcher, two nearest, both directions", [](const ImagePair& pair) {
    const DescriptorMatrix &d1 = pair.image1->descriptors, &d2 = pair.image2->descriptors;
    return Select(BruteForce(d1, d2), BruteForce(d2, d1));
  });
  table->Run("OpenCV BFMatcher, crossCheck (no ratio test)", [](const ImagePair& pair) {
    return BruteForceCrossCheck(pair.image1->descriptors, pair.image2->descriptors);
  });
  table->Run("FLANN, both directions, trees built for each pair", [](const ImagePair& pair) {
    const DescriptorMatrix &d1 = pair.image1->descriptors, &d2 = pair.image2->descriptors;
    FlannIndex index1(AsBytes(d1), cvflann::KDTreeIndexParams(kNumFlannTrees));
    FlannIndex index2(AsBytes(d2), cvflann::KDTreeIndexParams(kNumFlannTrees));
    return Select(SearchFlann(d1, d2, &index2), SearchFlann(d2, d1, &index1));
  });
  std::map<const Image*, FlannIndex> indices;
  for (const Image& image : images)
    indices.try_emplace(&image, AsBytes(image.descriptors), cvflann::KDTreeIndexParams(kNumFlannTrees));
  table->Run("FLANN, both directions, trees built once per image", [&](const ImagePair& pair) {
    const DescriptorMatrix &d1 = pair.image1->descriptors, &d2 = pair.image2->descriptors;
    return Select(SearchFlann(d1, d2, &indices.at(pair.image2)),
                  SearchFlann(d2, d1, &indices.at(pair.image1)));
  });
}

int Main(int argc, char** argv) {
  if (argc != 4) {
    std::fprintf(stderr, "usage: compare_matchers FEATURES.db COLMAP_MATCHES.db COLMAP_MS\n");
    return 2;
  }
  cv::setNumThreads(1);
  const Result<std::vector<Image>> images = ReadImages(argv[1]);
  Result<std::map<int64_t, Matches>> colmap = ReadMatches(argv[2]);
  if (!images.ok() || !colmap.ok()) {
    std::fprintf(stderr, "%s\n", (images.ok() ? colmap.error() : images.error()).message.c_str());
    return 1;
  }
  if (images->size() < 2) {
    std::fprintf(stderr, "%s: fewer than two images\n", argv[1]);
    return 1;
  }
  Table table(AllPairs(*images));
  double num_features = 0;
  for (const Image& image : *images) num_features += static_cast<double>(image.descriptors.rows());
  std::printf("\n%zu pairs of images with %.0f features on average\n\n", table.pairs().size(),
              num_features / static_cast<double>(images->size()));
  std::printf("| matcher | ms a pair | G multiply-adds/s of exact search | times cairn's | recall |\n");
  std::printf("|---|---|---|---|---|\n");
  if (!RunKernels(*images, &table)) {
    std::fprintf(stderr, "a kernel's matches differ from those of exact search\n");
    return 1;
  }
  std::vector<Matches> theirs;
  for (const ImagePair& pair : table.pairs())
    theirs.push_back((*colmap)[PairIdFromImageIds(pair.image1->image_id, pair.image2->image_id)]);
  table.Print("COLMAP 3.8, one thread, verification not counted", std::atof(argv[3]), theirs);
  RunPeers(*images, &table);
  return 0;
}

}  // namespace
}  // namespace cairn

int main(int argc, char** argv) { return cairn::Main(argc, argv); }
