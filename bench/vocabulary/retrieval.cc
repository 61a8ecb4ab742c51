// Share of queries for which the right place comes first, over the number of descriptors of a query, with and
// without stop list [Mariottini11 Fig. 5].
#include <algorithm>
#include <cstdio>
#include <fstream>
#include <map>
#include <optional>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include "core/colmap_database.h"
#include "core/random.h"
#include "core/recognize_place.h"
#include "stages/build_vocabulary/build_vocabulary.h"

namespace cairn {
namespace {

struct Images {
  std::vector<std::string> names;
  std::vector<ImageDescriptors> images;
};

Result<Images> ReadImages(const std::string& path) {
  CAIRN_ASSIGN_OR_RETURN(SQLite::Database database, OpenColmapDatabase(path));
  return WithDatabaseErrors(path, [&]() -> Result<Images> {
    Images images;
    CAIRN_ASSIGN_OR_RETURN(const std::vector<DatabaseImage> rows, ReadDatabaseImages(database));
    for (const DatabaseImage& row : rows) {
      CAIRN_ASSIGN_OR_RETURN(DescriptorMatrix descriptors, ReadDatabaseDescriptors(database, row.image_id));
      images.names.push_back(row.name);
      images.images.push_back({row.image_id, std::move(descriptors)});
    }
    return images;
  });
}

// Lines "QUERY SURVEY...": the survey images of the query's place; none where it has no place.
std::map<std::string, std::set<std::string>> ReadTruth(const std::string& path) {
  std::map<std::string, std::set<std::string>> truth;
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

// `count` rows drawn at random, all where there are no more or `count` is 0.
DescriptorMatrix DrawRows(const DescriptorMatrix& descriptors, int count, uint64_t seed) {
  if (count == 0 || descriptors.rows() <= count) return descriptors;
  Random random(seed);
  std::vector<Eigen::Index> rows(descriptors.rows());
  for (size_t i = 0; i < rows.size(); ++i) rows[i] = static_cast<Eigen::Index>(i);
  DescriptorMatrix drawn(count, kDescriptorDim);
  for (int i = 0; i < count; ++i) {
    std::swap(rows[i], rows[random.UniformInt(i, static_cast<int64_t>(rows.size()) - 1)]);
    drawn.row(i) = descriptors.row(rows[i]);
  }
  return drawn;
}

struct Arguments {
  std::string survey, queries, truth, elsewhere;
  std::vector<int> counts = {0, 400, 200, 100, 50, 25};
  std::vector<double> stop_ratios = {1, 0.5, 0.25};
  int num_draws = 20;
  uint64_t seed = 0;
  bool is_verbose = false;
  BuildVocabularyOptions options;
  PlaceOptions place;
};

struct Figures {
  double right = 0;      // queries of a place: right place first
  double wrong = 0;      // another
  double no_place = 0;   // queries of no place that get none
  double elsewhere = 0;  // images of another building that get one
};

class Retrieval {
 public:
  Retrieval(const Arguments& arguments, Images survey, Images queries, Images elsewhere)
      : arguments_(arguments),
        survey_(std::move(survey)),
        queries_(std::move(queries)),
        elsewhere_(std::move(elsewhere)),
        truth_(ReadTruth(arguments.truth)) {
    for (const std::string& name : queries_.names) {
      if (truth_.count(name) == 0) continue;
      ++(truth_[name].empty() ? num_without_place_ : num_with_place_);
    }
  }

  Status Run() {
    fmt::print("{} survey images; {} queries of a place, {} of none; {} images of another building\n",
               survey_.images.size(), num_with_place_, num_without_place_, elsewhere_.images.size());
    fmt::print("{:>6}{:>7}{:>6}{:>12}{:>9}{:>9}{:>11}{:>11}\n", "stop", "words", "depth", "descriptors",
               "right", "wrong", "none: ok", "elsewhere");
    for (const double stop_ratio : arguments_.stop_ratios) {
      BuildVocabularyOptions options = arguments_.options;
      options.max_document_ratio = stop_ratio;
      NoProgress progress;
      CAIRN_ASSIGN_OR_RETURN(const Vocabulary vocabulary,
                             BuildVocabulary(survey_.images, options, arguments_.seed, 2, progress));
      for (const int count : arguments_.counts) {
        const Figures figures = Measure(vocabulary, count);
        fmt::print("{:>6}{:>7}{:>6}{:>12}{:>9.2f}{:>9.2f}{:>11.2f}{:>11.2f}\n", stop_ratio,
                   vocabulary.num_words(), vocabulary.depth, count == 0 ? "all" : std::to_string(count),
                   figures.right, figures.wrong, figures.no_place, figures.elsewhere);
        std::fflush(stdout);
      }
    }
    return Ok();
  }

 private:
  std::optional<ScoredDocument> Place(const Vocabulary& vocabulary, const DescriptorMatrix& descriptors,
                                      int count, int draw) const {
    const DescriptorMatrix drawn =
        DrawRows(descriptors, count, MixSeed(arguments_.seed, static_cast<uint64_t>(draw)));
    return RecognizePlace(vocabulary, QuantizeDescriptors(vocabulary, drawn), arguments_.place);
  }

  // Means over the draws, in images.
  Figures Measure(const Vocabulary& vocabulary, int count) const {
    const int num_draws = count == 0 ? 1 : arguments_.num_draws;
    Figures sums;
    for (int draw = 0; draw < num_draws; ++draw) {
      for (size_t i = 0; i < queries_.images.size(); ++i) {
        const auto truth = truth_.find(queries_.names[i]);
        if (truth == truth_.end()) continue;
        const auto place = Place(vocabulary, queries_.images[i].descriptors, count, draw);
        const bool is_right = place && truth->second.count(survey_.names[place->document]) > 0;
        sums.right += is_right;
        if (truth->second.empty()) {
          sums.no_place += !place;
        } else {
          sums.wrong += place && !is_right;
        }
        if (arguments_.is_verbose && count == 0 && !is_right) {
          fmt::print(
              "  {}: {}\n", queries_.names[i],
              place ? fmt::format("{} {:.3f}", survey_.names[place->document], place->score) : "no place");
        }
      }
      for (const ImageDescriptors& image : elsewhere_.images) {
        sums.elsewhere += Place(vocabulary, image.descriptors, count, draw).has_value();
      }
    }
    for (double* sum : {&sums.right, &sums.wrong, &sums.no_place, &sums.elsewhere}) *sum /= num_draws;
    return sums;
  }

  const Arguments& arguments_;
  Images survey_, queries_, elsewhere_;
  std::map<std::string, std::set<std::string>> truth_;
  int num_with_place_ = 0, num_without_place_ = 0;
};

Status Run(const Arguments& arguments) {
  CAIRN_ASSIGN_OR_RETURN(Images survey, ReadImages(arguments.survey));
  CAIRN_ASSIGN_OR_RETURN(Images queries, ReadImages(arguments.queries));
  Images elsewhere;
  if (!arguments.elsewhere.empty()) {
    CAIRN_ASSIGN_OR_RETURN(elsewhere, ReadImages(arguments.elsewhere));
  }
  return Retrieval(arguments, std::move(survey), std::move(queries), std::move(elsewhere)).Run();
}

}  // namespace
}  // namespace cairn

int main(int argc, char** argv) {
  cairn::Arguments arguments;
  CLI::App app("Queries whose right place is retrieved first, over the number of descriptors");
  app.add_option("survey", arguments.survey, "features.db of the survey")->required();
  app.add_option("queries", arguments.queries, "features.db of the queries")->required();
  app.add_option("truth", arguments.truth, "lines QUERY SURVEY...")->required();
  app.add_option("--elsewhere", arguments.elsewhere, "features.db of another building");
  app.add_option("--descriptors", arguments.counts, "descriptors of a query; 0: all")->delimiter(',');
  app.add_option("--stop", arguments.stop_ratios, "stop lists: max_document_ratio")->delimiter(',');
  app.add_option("--draws", arguments.num_draws, "random draws of descriptors")->capture_default_str();
  app.add_option("--seed", arguments.seed, "seed of tree and draws")->capture_default_str();
  app.add_option("--branching", arguments.options.tree.branching)->capture_default_str();
  app.add_option("--depth", arguments.options.tree.depth)->capture_default_str();
  app.add_option("--descriptors-per-word", arguments.options.tree.descriptors_per_word)
      ->capture_default_str();
  app.add_option("--split", arguments.options.tree.min_num_descriptors_to_split)->capture_default_str();
  app.add_option("--min-num-words", arguments.place.min_num_words)->capture_default_str();
  app.add_option("--min-background-ratio", arguments.place.min_background_ratio)->capture_default_str();
  app.add_flag("--verbose", arguments.is_verbose, "list the queries that are not right, of all descriptors");
  CLI11_PARSE(app, argc, argv);
  if (const cairn::Status status = cairn::Run(arguments); !status.ok()) {
    fmt::print(stderr, "{}\n", status.error().message);
    return 1;
  }
  return 0;
}
