// Recall, time and memory of searches for the nearest of many descriptors: exact, FLANN's k-d trees, the
// words of a vocabulary tree, and, with the descriptors made binary, FLANN's hashes.  One thread.
//
//   search_curve FEATURES.db... -- SIZE...      prints rows of a Markdown table for each number of
//   descriptors that is searched
//
// Of every hundredth image the descriptors are queries, a thousand of them at most, those of all others, as
// many as SIZE says, are searched; both shuffled.  Where there are fewer, more are made of them: each a
// quarter of four of them, as another place might look. Recall: of the queries whose nearest is nearer than
// 0.8 of the second, as the exact search has them, the part whose nearest is found.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "core/base/progress.h"
#include "core/base/random.h"
#include "core/colmap/colmap_database.h"
#include "core/features/approximate_search.h"
#include "core/features/descriptor_distance.h"
#include "core/features/descriptor_matcher.h"
#include "core/line/memory.h"
#include "core/vocabulary/grow_vocabulary.h"

namespace cairn {
namespace {

constexpr int kNumQueries = 1000, kEveryImage = 100, kNumTraining = 200000;
constexpr double kMaxRatio = 0.8;

double CpuSeconds() {
  timespec time;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

double ResidentMib() {
  std::FILE* file = std::fopen("/proc/self/statm", "r");
  long size = 0, resident = 0;
  if (file == nullptr || std::fscanf(file, "%ld %ld", &size, &resident) != 2) return 0;
  std::fclose(file);
  return static_cast<double>(resident) * 4096 / (1 << 20);
}

// Queries and those that are searched.
struct Descriptors {
  std::vector<DescriptorRow> queries, searched;
};

Descriptors ReadAll(const std::vector<std::string>& paths) {
  Descriptors all;
  Random random(1);
  size_t num = 0;
  for (const std::string& path : paths) {
    auto database = OpenColmapDatabase(path);
    if (!database.ok()) {
      std::fprintf(stderr, "%s\n", database.error().message.c_str());
      std::exit(1);
    }
    const std::vector<DatabaseImage> images = *ReadDatabaseImages(*database);
    for (const DatabaseImage& image : images) {
      const DescriptorMatrix descriptors = *ReadDatabaseDescriptors(*database, image.image_id);
      auto& to = num++ % kEveryImage == kEveryImage / 2 ? all.queries : all.searched;
      for (int row = 0; row < descriptors.rows(); ++row) to.push_back(descriptors.row(row));
    }
  }
  for (auto* rows : {&all.queries, &all.searched}) {
    for (size_t i = rows->size(); i-- > 1;)
      std::swap((*rows)[i], (*rows)[random.UniformInt(0, static_cast<int64_t>(i))]);
  }
  all.queries.resize(std::min<size_t>(all.queries.size(), kNumQueries));
  return all;
}

DescriptorMatrix Rows(const std::vector<DescriptorRow>& rows, int64_t num) {
  DescriptorMatrix matrix(num, kSiftDescriptorDim);
  Random random(2);
  for (int64_t i = 0; i < num; ++i) {
    if (i < std::ssize(rows)) {
      matrix.row(i) = rows[i];
      continue;
    }
    constexpr int kQuarter = kSiftDescriptorDim / 4;
    for (int k = 0; k < 4; ++k) {
      const DescriptorRow& from = rows[random.UniformInt(0, std::ssize(rows) - 1)];
      matrix.row(i).segment(k * kQuarter, kQuarter) = from.segment(k * kQuarter, kQuarter);
    }
  }
  return matrix;
}

// Bits: whether a value is larger than most of its kind are.
DescriptorMatrix Binary(const DescriptorMatrix& descriptors, const DescriptorRow& limits, int offset) {
  DescriptorMatrix bits(descriptors.rows(), descriptors.cols());
  for (Eigen::Index i = 0; i < descriptors.rows(); ++i) {
    for (Eigen::Index k = 0; k < descriptors.cols(); ++k)
      bits(i, k) = static_cast<uint8_t>(descriptors(i, k) > limits[k] ? 2 * offset : 0);
  }
  return bits;
}

struct Found {
  PooledVector<BestTwo> best;
  double build_s = 0, query_ms = 0, mib = 0;
};

Found Measure(const std::function<std::function<void(PooledVector<BestTwo>*)>()>& build,
              int64_t num_queries) {
  Found found;
  ReturnFreedMemory();
  const double before_mib = ResidentMib(), start = CpuSeconds();
  const auto search = build();
  found.build_s = CpuSeconds() - start;
  const double begin = CpuSeconds();
  search(&found.best);
  found.query_ms = 1e3 * (CpuSeconds() - begin) / static_cast<double>(num_queries);
  found.mib = ResidentMib() - before_mib;
  return found;
}

Found Exact(const DescriptorMatrix& queries, const DescriptorMatrix& searched, const DescriptorSpace& space) {
  PackedDescriptors packed, packed_queries;
  return Measure(
      [&] {
        packed = PackedDescriptors(searched, space);
        packed_queries = PackedDescriptors(queries, space);
        return [&](PooledVector<BestTwo>* best) {
          PooledVector<BestTwo> columns;
          FindBestTwo(packed_queries, packed, best, &columns);
        };
      },
      queries.rows());
}

Found Flann(const DescriptorMatrix& queries, const DescriptorMatrix& searched, const DescriptorSpace& space) {
  std::unique_ptr<ApproximateIndex> index;
  return Measure(
      [&] {
        index = std::make_unique<ApproximateIndex>(searched, space);
        return [&](PooledVector<BestTwo>* best) { index->FindBestTwo(queries, best); };
      },
      queries.rows());
}

// Those of the same word, compared exactly.
Found Words(const DescriptorMatrix& queries, const DescriptorMatrix& searched) {
  Vocabulary vocabulary;
  std::vector<std::vector<int32_t>> of_word;
  return Measure(
      [&] {
        NoProgress progress;
        const Eigen::Index num_training = std::min<Eigen::Index>(kNumTraining, searched.rows());
        const DescriptorMatrix training(searched.topRows(num_training));
        vocabulary = *GrowVocabulary(training, {}, searched.rows(), {}, 0, 1, progress);
        of_word.resize(vocabulary.num_words());
        for (Eigen::Index i = 0; i < searched.rows(); ++i)
          of_word[QuantizeDescriptor(vocabulary, searched.row(i).data())].push_back(static_cast<int32_t>(i));
        return [&](PooledVector<BestTwo>* best) {
          best->assign(queries.rows(), {});
          std::vector<int32_t> dots;
          for (Eigen::Index q = 0; q < queries.rows(); ++q) {
            const auto& candidates = of_word[QuantizeDescriptor(vocabulary, queries.row(q).data())];
            dots.resize(candidates.size());
            DescriptorDots(queries.row(q).data(), searched, candidates, {}, dots.data());
            for (size_t i = 0; i < candidates.size(); ++i) (*best)[q].Offer(candidates[i], dots[i]);
          }
        };
      },
      queries.rows());
}

void Print(const char* name, int64_t size, const Found& found, const Found& exact,
           const DescriptorSpace& space) {
  int num = 0, num_found = 0;
  for (size_t q = 0; q < exact.best.size(); ++q) {
    const BestTwo& best = exact.best[q];
    if (best.idx < 0 ||
        !(DescriptorAngleRad(best.best, space) < kMaxRatio * DescriptorAngleRad(best.second, space)))
      continue;
    ++num;
    num_found += found.best[q].best == best.best;
  }
  std::printf("| %lld | %s | %.4f of %d | %.3f ms (x %.2f) | %.1f s | %.0f MiB |\n",
              static_cast<long long>(size), name, static_cast<double>(num_found) / std::max(1, num), num,
              found.query_ms, exact.query_ms / found.query_ms, found.build_s, found.mib);
  std::fflush(stdout);
}

void Run(const Descriptors& all, int64_t size) {
  const DescriptorMatrix queries = Rows(all.queries, std::ssize(all.queries));
  {
    const DescriptorMatrix searched = Rows(all.searched, size);
    const Found exact = Exact(queries, searched, {});
    Print("exact", size, exact, exact, {});
    Print("FLANN, 4 k-d trees, 128 checks", size, Flann(queries, searched, {}), exact, {});
    Print("words of a tree", size, Words(queries, searched), exact, {});
  }
  const DescriptorKind kind = {.type = DescriptorType::kBinary, .num_values = kSiftDescriptorDim};
  const DescriptorSpace space = kind.space();
  DescriptorRow limits(kSiftDescriptorDim);
  std::vector<uint8_t> values;
  for (int k = 0; k < kSiftDescriptorDim; ++k) {
    values.clear();
    for (const DescriptorRow& row : all.queries) values.push_back(row[k]);
    std::nth_element(values.begin(), values.begin() + std::ssize(values) / 2, values.end());
    limits[k] = values[values.size() / 2];
  }
  const DescriptorMatrix bits = Binary(Rows(all.searched, size), limits, space.offset);
  const DescriptorMatrix query_bits = Binary(queries, limits, space.offset);
  const Found exact = Exact(query_bits, bits, space);
  Print("128 bits: exact", size, exact, exact, space);
  Print("128 bits: FLANN, 12 tables of 20 bits", size, Flann(query_bits, bits, space), exact, space);
}

}  // namespace
}  // namespace cairn

int main(int argc, char** argv) {
  std::vector<std::string> paths;
  int i = 1;
  for (; i < argc && std::strcmp(argv[i], "--") != 0; ++i) paths.emplace_back(argv[i]);
  if (paths.empty() || i + 1 >= argc) {
    std::fprintf(stderr, "usage: search_curve FEATURES.db... -- SIZE...\n");
    return 2;
  }
  const cairn::Descriptors all = cairn::ReadAll(paths);
  if (all.queries.empty() || all.searched.empty()) {
    std::fprintf(stderr, "search_curve: fewer than 51 images, or none with descriptors\n");
    return 1;
  }
  std::printf("%zu queries, %zu descriptors to search\n\n", all.queries.size(), all.searched.size());
  std::printf(
      "| searched | by | nearest found | a query (times faster than exact) | to build | memory "
      "|\n|---|---|---|---|---|---|\n");
  for (++i; i < argc; ++i) cairn::Run(all, std::atoll(argv[i]));
  return 0;
}
