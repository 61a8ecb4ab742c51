// Share of queries for which the right place comes first, over the number of descriptors of a query, with and
// without stop list [Mariottini11 Fig. 5], by words alone and with the first candidates verified.
#include <algorithm>
#include <cstdio>
#include <ctime>
#include <fstream>
#include <map>
#include <numeric>
#include <optional>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include "core/base/parallel.h"
#include "core/base/random.h"
#include "core/colmap/colmap_database.h"
#include "core/vocabulary/recognize_place.h"
#include "core/vocabulary/rerank_places.h"
#include "stages/build_vocabulary/build_vocabulary.h"

namespace cairn {
namespace {

struct Image {
  std::string name;
  Camera camera;
  Features features;
};

struct Images {
  std::vector<Image> images;
  std::vector<PlaceView> views;
};

Result<Images> ReadImages(const std::string& path) {
  CAIRN_ASSIGN_OR_RETURN(SQLite::Database database, OpenColmapDatabase(path));
  return WithDatabaseErrors(path, [&]() -> Result<Images> {
    Images images;
    CAIRN_ASSIGN_OR_RETURN(const auto cameras, ReadDatabaseCameras(database));
    CAIRN_ASSIGN_OR_RETURN(const std::vector<DatabaseImage> rows, ReadDatabaseImages(database));
    for (const DatabaseImage& row : rows) {
      Features features;
      CAIRN_ASSIGN_OR_RETURN(features.keypoints, ReadDatabaseKeypoints(database, row.image_id));
      CAIRN_ASSIGN_OR_RETURN(features.descriptors, ReadDatabaseDescriptors(database, row.image_id));
      images.views.push_back(MakePlaceView(features, cameras.at(row.camera_id)));
      images.images.push_back({row.name, cameras.at(row.camera_id), std::move(features)});
    }
    return images;
  });
}

using Truth = std::map<std::string, std::set<std::string>>;

// Lines "QUERY SURVEY...": the survey images of the query's place; none where it has no place.
Truth ReadTruth(const std::string& path) {
  Truth truth;
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);) {
    std::istringstream words(line);
    std::string query;
    if (!(words >> query)) continue;
    for (std::string name; words >> name;) truth[query].insert(name);
    truth[query];
  }
  return truth;
}

// `count` features drawn at random, all where there are no more or `count` is 0.
Features Draw(const Features& features, int count, uint64_t seed) {
  const auto num_all = static_cast<int64_t>(features.keypoints.size());
  if (count == 0 || num_all <= count) return features;
  Random random(seed);
  std::vector<int64_t> rows(num_all);
  std::iota(rows.begin(), rows.end(), 0);
  Features drawn;
  drawn.descriptors.resize(count, kSiftDescriptorDim);
  for (int i = 0; i < count; ++i) {
    std::swap(rows[i], rows[random.UniformInt(i, num_all - 1)]);
    drawn.keypoints.push_back(features.keypoints[rows[i]]);
    drawn.descriptors.row(i) = features.descriptors.row(rows[i]);
  }
  return drawn;
}

struct Arguments {
  std::string survey, queries, truth, strict_truth, elsewhere;
  std::vector<int> counts = {0, 400, 200, 100, 50, 25};
  std::vector<double> stop_ratios = {1, 0.5, 0.25};
  std::vector<int> num_verified = {0};
  int num_draws = 20;
  int num_threads = 2;
  uint64_t seed = 0;
  bool is_verbose = false;
  build_vocabulary::BuildVocabularyOptions options;
  PlaceOptions place;
  RerankOptions rerank;
};

// Means over draws.
struct Figures {
  double right = 0;         // queries of a place: right place first
  double right_strict = 0;  // the same by the stricter truth
  double wrong = 0;         // another
  double no_place = 0;      // queries of no place that get none
  double elsewhere = 0;     // images of another building that get one
  double seconds = 0;       // processor time of a query beyond its features
};

// Processor time of the calling thread.
double ThreadSeconds() {
  timespec time;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

struct Answer {
  std::optional<int32_t> document;
  double seconds = 0;
};

class Retrieval {
 public:
  Retrieval(const Arguments& arguments, const Images& survey, const Images& queries, const Images& elsewhere)
      : arguments_(arguments),
        survey_(survey),
        queries_(queries),
        elsewhere_(elsewhere),
        truth_(ReadTruth(arguments.truth)),
        strict_truth_(ReadTruth(arguments.strict_truth)) {
    for (const Image& image : queries_.images) {
      if (truth_.count(image.name) == 0) continue;
      ++(truth_[image.name].empty() ? num_without_place_ : num_with_place_);
    }
  }

  Status Run() {
    fmt::print("{} survey images; {} queries of a place, {} of none; {} images of another building\n",
               survey_.images.size(), num_with_place_, num_without_place_, elsewhere_.images.size());
    fmt::print("{:>6}{:>7}{:>6}{:>12}{:>9}{:>9}{:>9}{:>9}{:>9}{:>10}{:>9}\n", "stop", "words", "depth",
               "descriptors", "verified", "right", "strict", "wrong", "none: ok", "elsewhere", "ms");
    std::vector<build_vocabulary::ImageDescriptors> documents;
    for (const Image& image : survey_.images)
      documents.push_back({static_cast<ImageId>(documents.size() + 1), image.features.descriptors});
    for (const double stop_ratio : arguments_.stop_ratios) {
      build_vocabulary::BuildVocabularyOptions options = arguments_.options;
      options.max_document_ratio = stop_ratio;
      NoProgress progress;
      CAIRN_ASSIGN_OR_RETURN(const Vocabulary vocabulary,
                             build_vocabulary::BuildVocabulary(documents, {}, options, arguments_.seed,
                                                               arguments_.num_threads, progress));
      for (const int count : arguments_.counts) {
        for (const int num_verified : arguments_.num_verified) {
          const Figures f = Measure(vocabulary, count, num_verified);
          fmt::print("{:>6}{:>7}{:>6}{:>12}{:>9}{:>9.2f}{:>9.2f}{:>9.2f}{:>9.2f}{:>10.2f}{:>9.2f}\n",
                     stop_ratio, vocabulary.num_words(), vocabulary.depth,
                     count == 0 ? "all" : std::to_string(count), num_verified, f.right, f.right_strict,
                     f.wrong, f.no_place, f.elsewhere, 1e3 * f.seconds);
          std::fflush(stdout);
        }
      }
    }
    return Ok();
  }

 private:
  // The first candidate that is verified; else what the words say.
  Answer Place(const Vocabulary& vocabulary, const Image& image, int count, int draw,
               int num_verified) const {
    const Features drawn = Draw(image.features, count, MixSeed(arguments_.seed, static_cast<uint64_t>(draw)));
    const double begin = ThreadSeconds();
    const std::vector<WordIdx> words = QuantizeDescriptors(vocabulary, drawn.descriptors);
    Answer answer;
    if (num_verified > 0) {
      const auto candidates = RankDocuments(vocabulary, words, num_verified);
      std::vector<const PlaceView*> views;
      for (const ScoredDocument& candidate : candidates) views.push_back(&survey_.views[candidate.document]);
      RerankOptions options = arguments_.rerank;
      options.num_candidates = num_verified;
      const auto places = RerankPlaces(MakePlaceView(drawn, image.camera), views, options, 1);
      if (!places->empty() && places->front().is_verified())
        answer.document = candidates[places->front().candidate].document;
    }
    if (!answer.document) {
      const auto place = RecognizePlace(vocabulary, words, arguments_.place);
      if (place) answer.document = place->document;
    }
    answer.seconds = ThreadSeconds() - begin;
    return answer;
  }

  std::vector<Answer> Places(const Vocabulary& vocabulary, const Images& images, int count, int draw,
                             int num_verified) const {
    std::vector<Answer> answers(images.images.size());
    ParallelFor(static_cast<int64_t>(answers.size()), arguments_.num_threads, [&](int64_t i) {
      answers[i] = Place(vocabulary, images.images[i], count, draw, num_verified);
    });
    return answers;
  }

  // [Mariottini11 Fig. 5] Means over the draws, in images.
  Figures Measure(const Vocabulary& vocabulary, int count, int num_verified) const {
    const int num_draws = count == 0 ? 1 : arguments_.num_draws;
    Figures sums;
    for (int draw = 0; draw < num_draws; ++draw) {
      const std::vector<Answer> answers = Places(vocabulary, queries_, count, draw, num_verified);
      for (size_t i = 0; i < answers.size(); ++i)
        Count(queries_.images[i].name, answers[i], count == 0, &sums);
      for (const Answer& answer : Places(vocabulary, elsewhere_, count, draw, num_verified))
        sums.elsewhere += answer.document.has_value();
    }
    for (double* sum : {&sums.right, &sums.right_strict, &sums.wrong, &sums.no_place, &sums.elsewhere})
      *sum /= num_draws;
    sums.seconds /= static_cast<double>(num_draws) * static_cast<double>(queries_.images.size());
    return sums;
  }

  void Count(const std::string& query, const Answer& answer, bool may_list, Figures* sums) const {
    sums->seconds += answer.seconds;
    const auto truth = truth_.find(query);
    if (truth == truth_.end()) return;
    const std::string name = answer.document ? survey_.images[*answer.document].name : "no place";
    const bool is_right = truth->second.count(name) > 0;
    sums->right += is_right;
    const auto strict = strict_truth_.find(query);
    sums->right_strict += strict != strict_truth_.end() && strict->second.count(name) > 0;
    if (truth->second.empty()) {
      sums->no_place += !answer.document;
    } else {
      sums->wrong += answer.document && !is_right;
    }
    if (arguments_.is_verbose && may_list && !is_right) fmt::print("  {}: {}\n", query, name);
  }

  const Arguments& arguments_;
  const Images &survey_, &queries_, &elsewhere_;
  Truth truth_, strict_truth_;
  int num_with_place_ = 0, num_without_place_ = 0;
};

Status Run(const Arguments& arguments) {
  CAIRN_ASSIGN_OR_RETURN(const Images survey, ReadImages(arguments.survey));
  CAIRN_ASSIGN_OR_RETURN(const Images queries, ReadImages(arguments.queries));
  Images elsewhere;
  if (!arguments.elsewhere.empty()) {
    CAIRN_ASSIGN_OR_RETURN(elsewhere, ReadImages(arguments.elsewhere));
  }
  return Retrieval(arguments, survey, queries, elsewhere).Run();
}

}  // namespace
}  // namespace cairn

int main(int argc, char** argv) {
  cairn::Arguments arguments;
  CLI::App app("Queries whose right place is retrieved first, over the number of descriptors");
  app.add_option("survey", arguments.survey, "features.db of the survey")->required();
  app.add_option("queries", arguments.queries, "features.db of the queries")->required();
  app.add_option("truth", arguments.truth, "lines QUERY SURVEY...")->required();
  app.add_option("--strict", arguments.strict_truth, "the same, of a stricter kind, counted beside");
  app.add_option("--elsewhere", arguments.elsewhere, "features.db of another building");
  app.add_option("--descriptors", arguments.counts, "descriptors of a query; 0: all")->delimiter(',');
  app.add_option("--stop", arguments.stop_ratios, "stop lists: max_document_ratio")->delimiter(',');
  app.add_option("--verify", arguments.num_verified, "candidates that are verified; 0: words alone")
      ->delimiter(',');
  app.add_option("--draws", arguments.num_draws, "random draws of descriptors")->capture_default_str();
  app.add_option("--seed", arguments.seed, "seed of tree and draws")->capture_default_str();
  app.add_option("--branching", arguments.options.tree.branching)->capture_default_str();
  app.add_option("--depth", arguments.options.tree.depth)->capture_default_str();
  app.add_option("--descriptors-per-word", arguments.options.tree.descriptors_per_word)
      ->capture_default_str();
  app.add_option("--split", arguments.options.tree.min_num_descriptors_to_split)->capture_default_str();
  app.add_option("--min-num-words", arguments.place.min_num_words)->capture_default_str();
  app.add_option("--max-log10-chance", arguments.place.max_log10_chance)->capture_default_str();
  app.add_option("--min-num-inliers", arguments.rerank.min_num_inliers)->capture_default_str();
  app.add_option("--baseline-ratio", arguments.rerank.baseline_ratio)->capture_default_str();
  app.add_option("--max-num-samples", arguments.rerank.max_num_samples)->capture_default_str();
  app.add_option("--threads", arguments.num_threads)->capture_default_str();
  app.add_flag("--verbose", arguments.is_verbose, "list the queries that are not right, of all descriptors");
  CLI11_PARSE(app, argc, argv);
  if (const cairn::Status status = cairn::Run(arguments); !status.ok()) {
    fmt::print(stderr, "{}\n", status.error().message);
    return 1;
  }
  return 0;
}
