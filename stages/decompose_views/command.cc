#include "stages/decompose_views/command.h"

#include <map>

#include <spdlog/spdlog.h>

#include "core/files/file.h"
#include "core/plan/views_database.h"
#include "stages/decompose_views/decompose_views.h"
#include "stages/decompose_views/picture.h"

namespace cairn::decompose_views {
namespace {

struct Arguments {
  std::string plan;
  std::string output;
  std::string svg;
  DecomposeViewsOptions options;
  OptionArguments option_arguments;
};

void WriteChanges(SQLite::Database& database, const std::vector<PlanChange>& changes) {
  SQLite::Statement row(database, "INSERT INTO plan_changes VALUES (?, ?, ?, ?, ?, ?)");
  for (const PlanChange& change : changes) {
    row.bind(1, static_cast<int>(change.kind));
    row.bind(2, PlanChangeName(change.kind));
    row.bind(3, change.line);
    row.bind(4, change.place.x());
    row.bind(5, change.place.y());
    row.bind(6, change.moved_m);
    row.exec();
    row.reset();
  }
}

void PrintChanges(const std::vector<PlanChange>& changes, std::ostream& out) {
  struct Sum {
    int64_t count = 0;
    double farthest_m = 0;
  };
  std::map<PlanChangeKind, Sum> sums;
  for (const PlanChange& change : changes) {
    Sum& sum = sums[change.kind];
    ++sum.count;
    sum.farthest_m = std::max(sum.farthest_m, change.moved_m);
  }
  for (const auto& [kind, sum] : sums) {
    out << fmt::format("decompose_views: {} {}", sum.count, PlanChangeName(kind));
    if (sum.farthest_m > 0) out << fmt::format(", by {:.4f} m at most", sum.farthest_m);
    out << "\n";
  }
}

Status Run(const Arguments& arguments, const CommandEnvironment& environment) {
  CAIRN_RETURN_IF_ERROR(arguments.option_arguments.Apply());
  CAIRN_ASSIGN_OR_RETURN(const InputPlan input, ReadPlan(arguments.plan, arguments.options.read));
  for (const std::string& note : input.notes) *environment.out << "decompose_views: " << note << "\n";
  const Result<DecomposeViewsResult> result = DecomposeViews(
      input, arguments.options, environment.num_threads, environment.memory_mib, *environment.progress);
  if (!result.ok()) return MakeError(result.error().code, "{}: {}", arguments.plan, result.error().message);
  const Views& views = result->views;
  environment.report->in = {{"walls", static_cast<int64_t>(input.segments.size())},
                            {"rings", static_cast<int64_t>(input.rings.size())}};
  environment.report->out = {{"regions", views.num_faces()}, {"walls", views.plan.num_walls()}};
  PrintChanges(result->changes, *environment.out);
  double num_labels = 0;
  for (const ViewIndex& index : views.index) num_labels += index.num_labels;
  *environment.out << fmt::format(
      "decompose_views: {} walls, {} view boundaries, {} regions, {:.1f} labels in the mean, {:.2f} changes "
      "stored for each\n",
      views.plan.num_walls(), result->num_boundaries, views.num_faces(),
      num_labels / std::max(1, views.num_faces()),
      static_cast<double>(views.toggled_labels.size()) / std::max(1, views.num_faces()));
  if (result->loss.num_regions > 0) {
    *environment.out << fmt::format(
        "decompose_views: {} regions of {:.3f} m2 together joined to neighbours, whose label sets differ "
        "from theirs by {:.2f} labels in the mean\n",
        result->loss.num_regions, result->loss.area_m2,
        static_cast<double>(result->loss.num_labels) / static_cast<double>(result->loss.num_regions));
  }
  if (result->num_disagreements > 0) {
    spdlog::warn("{} borders of {} do not agree with the label sets beside them", result->num_disagreements,
                 views.links.size());
  }
  if (!arguments.svg.empty()) CAIRN_RETURN_IF_ERROR(WriteFileAtomically(arguments.svg, DrawViews(views)));
  return WriteViews(views, arguments.output, *environment.progress,
                    [&](SQLite::Database& database) -> Status {
                      WriteChanges(database, result->changes);
                      return Ok();
                    });
}

}  // namespace

Command DecomposeViewsCommand() {
  auto arguments = std::make_shared<Arguments>();
  Command command;
  command.name = "decompose";
  command.stage = "decompose_views";
  command.former_names = {"decompose-views"};
  command.summary = "Divide a floor plan into regions from which a laser sees the same walls";
  command.add_arguments = [arguments](ArgumentParser& parser) {
    parser
        .Add("plan", arguments->plan,
             "floor plan: GeoJSON, DXF, the YAML file of a ROS map, or lines x0,y0,x1,y1 of walls")
        .Required()
        .Type("FILE");
    parser.Add("-o,--output", arguments->output, "regions to write (views.db)").Required().Type("FILE");
    parser.Add("--svg", arguments->svg, "also draw the regions as SVG").Type("FILE.svg");
    arguments->option_arguments.Add(parser, DescribeOptions(&arguments->options));
  };
  command.run = [arguments](const CommandEnvironment& environment) { return Run(*arguments, environment); };
  return command;
}

}  // namespace cairn::decompose_views
