// Build, query, bytes and right answers of the vocabulary tree on invented places, beside a bag of words in
// the usual way and faiss on the same descriptors.
#include <sys/resource.h>

#include <chrono>
#include <cstdio>
#include <ctime>
#include <functional>
#include <numeric>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include "bench/vocabulary/bag_of_words_peer.h"
#include "bench/vocabulary/synthetic_places.h"
#include "core/base/parallel.h"
#include "core/blocks/map_blocks.h"
#include "stages/build_vocabulary/build_vocabulary.h"
#ifdef CAIRN_HAS_FAISS
#include "bench/vocabulary/faiss_peer.h"
#endif

namespace cairn {
namespace {

double Now() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

struct Survey {
  std::vector<build_vocabulary::ImageDescriptors> images;
  std::vector<DescriptorMatrix> queries;
  std::vector<int> places;  // of the queries
};

Survey MakeSurvey(const SyntheticPlaces& places, int num_queries, double clutter_ratio, int num_threads) {
  Survey survey;
  const DescriptorMatrix families = Families(places);
  survey.images.resize(places.num_places);
  ParallelFor(places.num_places, num_threads, [&](int64_t i) {
    survey.images[i] = {static_cast<ImageId>(i + 1),
                        ViewOfPlace(places, families, static_cast<int>(i), 0, 0)};
  });
  for (int i = 0; i < num_queries; ++i) {
    survey.places.push_back(static_cast<int>(int64_t{i} * places.num_places / num_queries));
    survey.queries.push_back(ViewOfPlace(places, families, survey.places.back(), 1, clutter_ratio));
  }
  return survey;
}

// Of all threads together: what other programs do on the machine hardly counts.
double CpuSeconds() {
  timespec time{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

struct Row {
  std::string method;
  int64_t num_words = 0;
  double train_s = 0, fill_s = 0;    // processor time of all threads
  double elapsed_s = 0;              // of both
  double words_ms = 0, rest_ms = 0;  // processor time of a query, one thread
  double right = 0;
};

void PrintHead() {
  fmt::print("{:<46}{:>8}{:>14}{:>14}{:>12}{:>10}{:>10}{:>13}\n", "method", "words", "train, CPU s",
             "fill, CPU s", "elapsed, s", "words, ms", "rest, ms", "first right");
}

void Print(const Row& row) {
  fmt::print("{:<46}{:>8}{:>14.1f}{:>14.1f}{:>12.1f}{:>10.3f}{:>10.3f}{:>12.1f}%\n", row.method,
             row.num_words, row.train_s, row.fill_s, row.elapsed_s, row.words_ms, row.rest_ms,
             100 * row.right);
  std::fflush(stdout);
}

// Words of a query, then the best document for them, each timed.
template <typename Words>
void TimeQueries(const Survey& survey, const std::function<Words(const DescriptorMatrix&)>& words,
                 const std::function<int(const Words&)>& best, Row* row) {
  double words_s = 0, rest_s = 0;
  int num_right = 0;
  for (size_t i = 0; i < survey.queries.size(); ++i) {
    const double start = CpuSeconds();
    const Words of_query = words(survey.queries[i]);
    const double middle = CpuSeconds();
    num_right += best(of_query) == survey.places[i];
    rest_s += CpuSeconds() - middle;
    words_s += middle - start;
  }
  const auto num_queries = static_cast<double>(survey.queries.size());
  row->words_ms = 1000 * words_s / num_queries;
  row->rest_ms = 1000 * rest_s / num_queries;
  row->right = num_right / num_queries;
}

int BestDocument(const Vocabulary& vocabulary, const std::vector<WordIdx>& words) {
  const std::vector<ScoredDocument> scored = RankDocuments(vocabulary, words, 20);
  return scored.empty() ? -1 : scored[0].document;
}

// Notes the processor time at which each piece of work begins.
struct Times : Progress {
  std::vector<double> begins;
  void Begin(std::string_view, int64_t, std::string_view) override { begins.push_back(CpuSeconds()); }
  void Advance(int64_t) override {}
  void End() override {}
};

void PrintBytes(const Vocabulary& vocabulary) {
  int64_t num_postings = 0, word_bytes = 0;
  for (int word = 0; word < vocabulary.num_words(); ++word) {
    num_postings += static_cast<int64_t>(vocabulary.inverted_files[word].size());
    word_bytes += static_cast<int64_t>(PackWords(word, {vocabulary.inverted_files[word]}).bytes.size());
  }
  const auto per_posting = [&](int64_t bytes) {
    return static_cast<double>(bytes) / static_cast<double>(num_postings);
  };
  const int64_t norm_bytes = static_cast<int64_t>(EncodeDocumentNorms(vocabulary.document_norms).size());
  const int64_t tree_bytes = static_cast<int64_t>(EncodeVocabularyTree(vocabulary).size());
  fmt::print(
      "  in a map: {} postings, {:.3f} bytes each; with document norms {:.3f}, with the tree too {:.3f}\n",
      num_postings, per_posting(word_bytes), per_posting(word_bytes + norm_bytes),
      per_posting(word_bytes + norm_bytes + tree_bytes));
}

Vocabulary RunTree(const Survey& survey, const build_vocabulary::BuildVocabularyOptions& options,
                   int num_threads, const std::string& name) {
  Times times;
  const double start = CpuSeconds(), start_elapsed = Now();
  Vocabulary vocabulary =
      *build_vocabulary::BuildVocabulary(survey.images, {}, options, 0, num_threads, times);
  const double end = CpuSeconds();
  Row row{.method = name, .num_words = vocabulary.num_words()};
  row.elapsed_s = Now() - start_elapsed;
  row.train_s = times.begins[1] - start;
  row.fill_s = end - times.begins[1];
  TimeQueries<std::vector<WordIdx>>(
      survey, [&](const DescriptorMatrix& query) { return QuantizeDescriptors(vocabulary, query); },
      [&](const std::vector<WordIdx>& words) { return BestDocument(vocabulary, words); }, &row);
  Print(row);
  PrintBytes(vocabulary);
  return vocabulary;
}

DescriptorMatrix Sample(const Survey& survey, int64_t count) {
  int64_t total = 0;
  for (const build_vocabulary::ImageDescriptors& image : survey.images) total += image.descriptors.rows();
  const int64_t step = std::max<int64_t>(1, total / count);
  DescriptorMatrix sample((total + step - 1) / step, kSiftDescriptorDim);
  int64_t first = 0;
  for (const build_vocabulary::ImageDescriptors& image : survey.images) {
    const int64_t num_rows = image.descriptors.rows();
    for (int64_t i = (first + step - 1) / step * step; i < first + num_rows; i += step) {
      sample.row(i / step) = image.descriptors.row(i - first);
    }
    first += num_rows;
  }
  return sample;
}

void RunBagOfWords(const Survey& survey, const DescriptorMatrix& training, int depth) {
  BagOfWordsPeer peer;
  double start = CpuSeconds();
  const double start_elapsed = Now();
  peer.Train(training, {.depth = depth});
  Row row{.method = "bags of words as in DBoW2 (one thread)", .num_words = peer.num_words()};
  row.train_s = CpuSeconds() - start;
  std::vector<const DescriptorMatrix*> documents;
  for (const build_vocabulary::ImageDescriptors& image : survey.images)
    documents.push_back(&image.descriptors);
  start = CpuSeconds();
  peer.AddDocuments(documents);
  row.fill_s = CpuSeconds() - start;
  row.elapsed_s = Now() - start_elapsed;
  TimeQueries<BagOfWordsPeer::Bag>(
      survey, [&](const DescriptorMatrix& query) { return peer.Transform(query); },
      [&](const BagOfWordsPeer::Bag& bag) {
        const auto scored = peer.Query(bag, 20);
        return scored.empty() ? -1 : scored[0].second;
      },
      &row);
  Print(row);
}

#ifdef CAIRN_HAS_FAISS
// Documents by our scoring over words of another quantiser.
void RunFaissWords(const Survey& survey, const DescriptorMatrix& training, int num_words, int num_iterations,
                   bool is_graph, int num_threads) {
  SetFaissThreads(num_threads);
  FaissPeer peer;
  double start = CpuSeconds();
  const double start_elapsed = Now();
  peer.Train(training, num_words, num_iterations, is_graph);
  Row row{.method = fmt::format("faiss: flat k-means, {} words, our scores", is_graph ? "graph" : "exact"),
          .num_words = num_words};
  row.train_s = CpuSeconds() - start;
  start = CpuSeconds();
  Vocabulary vocabulary;
  vocabulary.inverted_files.resize(num_words);
  const auto sorted_words = [&](const DescriptorMatrix& descriptors) {
    const std::vector<int64_t> of_image = peer.Words(descriptors);
    std::vector<WordIdx> words(of_image.begin(), of_image.end());
    std::sort(words.begin(), words.end());
    return words;
  };
  for (const build_vocabulary::ImageDescriptors& image : survey.images) {
    const auto document = static_cast<int32_t>(vocabulary.document_ids.size());
    vocabulary.document_ids.push_back(image.image_id);
    for (const WordIdx word : sorted_words(image.descriptors)) {
      std::vector<Posting>& postings = vocabulary.inverted_files[word];
      if (postings.empty() || postings.back().document != document) postings.push_back({document, 0});
      ++postings.back().count;
    }
  }
  WeightVocabulary(&vocabulary);
  row.fill_s = CpuSeconds() - start;
  row.elapsed_s = Now() - start_elapsed;
  SetFaissThreads(1);
  TimeQueries<std::vector<WordIdx>>(
      survey, sorted_words,
      [&](const std::vector<WordIdx>& words) { return BestDocument(vocabulary, words); }, &row);
  Print(row);
  if (is_graph) return;

  // Votes of nearest descriptors, without words.
  Row vote_row{.method = "faiss: IVF of descriptors, 8 of 16 lists vote", .num_words = num_words};
  vote_row.train_s = row.train_s;
  SetFaissThreads(num_threads);
  start = CpuSeconds();
  const double vote_elapsed = Now();
  for (size_t i = 0; i < survey.images.size(); ++i) {
    peer.Add(survey.images[i].descriptors, static_cast<int64_t>(i));
  }
  vote_row.fill_s = CpuSeconds() - start;
  vote_row.elapsed_s = Now() - vote_elapsed;
  SetFaissThreads(1);
  const int num_documents = static_cast<int>(survey.images.size());
  TimeQueries<const DescriptorMatrix*>(
      survey, [](const DescriptorMatrix& query) { return &query; },
      [&](const DescriptorMatrix* const& query) {
        const std::vector<int> votes = peer.Vote(*query, num_documents, 8, 16);
        return static_cast<int>(std::max_element(votes.begin(), votes.end()) - votes.begin());
      },
      &vote_row);
  Print(vote_row);
}
#endif

struct Arguments {
  SyntheticPlaces places;
  int num_queries = 200;
  double clutter_ratio = 0.5;
  int num_threads = 2;
  int num_peer_training = 200000;
  int num_flat_words = 10000;
  bool train_with_all = false;
  bool bag_of_words = false;
  bool faiss = false;
  build_vocabulary::BuildVocabularyOptions options;
};

void Run(const Arguments& arguments) {
  const double start = Now();
  const Survey survey =
      MakeSurvey(arguments.places, arguments.num_queries, arguments.clutter_ratio, arguments.num_threads);
  fmt::print("{} images of {} descriptors, {} queries, made in {:.0f} s; {} threads build, one queries\n",
             survey.images.size(), arguments.places.num_features, survey.queries.size(), Now() - start,
             arguments.num_threads);
  PrintHead();
  build_vocabulary::BuildVocabularyOptions options = arguments.options;
  const Vocabulary tree =
      RunTree(survey, options, arguments.num_threads,
              fmt::format("cairn, trained with {} of them", options.max_num_training_descriptors));
  if (arguments.train_with_all) {
    options.max_num_training_descriptors = std::numeric_limits<int>::max();
    RunTree(survey, options, arguments.num_threads, "cairn, trained with all");
  }
  const DescriptorMatrix training = Sample(survey, arguments.num_peer_training);
  if (arguments.bag_of_words) RunBagOfWords(survey, training, tree.depth);
#ifdef CAIRN_HAS_FAISS
  if (arguments.faiss) {
    for (const bool is_graph : {true, false}) {
      RunFaissWords(survey, training, arguments.num_flat_words, options.tree.max_num_iterations, is_graph,
                    arguments.num_threads);
    }
  }
#else
  if (arguments.faiss) fmt::print("faiss: not built in; install libfaiss-dev and configure again\n");
#endif
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  fmt::print("peak memory {:.0f} MiB\n", static_cast<double>(usage.ru_maxrss) / 1024);
}

}  // namespace
}  // namespace cairn

int main(int argc, char** argv) {
  cairn::Arguments arguments;
  CLI::App app("Vocabulary tree beside bags of words and faiss, on the same invented descriptors");
  app.add_option("--images", arguments.places.num_places, "images")->capture_default_str();
  app.add_option("--features", arguments.places.num_features, "descriptors of an image")
      ->capture_default_str();
  app.add_option("--view-sigma", arguments.places.view_sigma, "noise of a view")->capture_default_str();
  app.add_option("--queries", arguments.num_queries, "queries")->capture_default_str();
  app.add_option("--clutter", arguments.clutter_ratio, "part of a query that is of no place")
      ->capture_default_str();
  app.add_option("--threads", arguments.num_threads, "threads that build")->capture_default_str();
  app.add_option("--depth", arguments.options.tree.depth, "levels; 0: from the data")->capture_default_str();
  app.add_option("--train", arguments.options.max_num_training_descriptors,
                 "descriptors that train cairn's tree")
      ->capture_default_str();
  app.add_flag("--train-with-all", arguments.train_with_all, "and once with all");
  app.add_option("--peer-train", arguments.num_peer_training, "descriptors that train the peers")
      ->capture_default_str();
  app.add_option("--flat-words", arguments.num_flat_words, "words of faiss")->capture_default_str();
  app.add_flag("--bag-of-words", arguments.bag_of_words, "with bags of words");
  app.add_flag("--faiss", arguments.faiss, "with faiss");
  CLI11_PARSE(app, argc, argv);
  cairn::Run(arguments);
  return 0;
}
