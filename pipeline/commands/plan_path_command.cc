#include "pipeline/commands/commands.h"

#include <cmath>

#include <spdlog/spdlog.h>
#include <nlohmann/json.hpp>

#include "core/files/file.h"
#include "core/geometry/pose.h"
#include "core/plan/views.h"
#include "pipeline/commands/path_json.h"
#include "pipeline/program/json_text.h"
#include "runtime/map/open_views.h"
#include "runtime/paths/disambiguate.h"
#include "runtime/paths/plan_path.h"
#include "runtime/paths/search_path.h"
#include "stages/decompose_views/picture.h"

namespace cairn::pipeline {
namespace {

using nlohmann::ordered_json;
using Vec2 = Eigen::Vector2d;

struct PathArguments {
  std::string views;
  std::vector<double> from, to;
  std::string kind = "short";
  std::string svg;
  PlanPathOptions options;
  OptionArguments option_arguments;
};

// What a search says beside its path.
void AddSearch(const SearchPath& search, ordered_json* line, decompose_views::ViewsOverlay* overlay) {
  ordered_json unseen = ordered_json::array();
  for (const FloorPart& part : search.unseen) {
    unseen.push_back({{"area_m2", part.area_m2}, {"at", {part.at.x(), part.at.y()}}});
    overlay->areas.insert(overlay->areas.end(), part.pieces.begin(), part.pieces.end());
  }
  (*line)["places"] = PathJson(search.places);
  (*line)["fewest_places"] = search.fewest_places;
  (*line)["domain_area_m2"] = search.domain_area_m2;
  (*line)["seen_area_m2"] = search.seen_area_m2;
  (*line)["visible_area_m2"] = search.visible_area_m2;
  (*line)["unseen_area_m2"] = search.unseen_area_m2();
  (*line)["unseen"] = unseen;
  (*line)["unreached_area_m2"] = search.unreached_area_m2;
  overlay->captions = {
      fmt::format("{} places to look around from;", search.places.size()),
      fmt::format("{} are needed at least", search.fewest_places),
      fmt::format("seen: {:.1f} of {:.1f} m²", search.seen_area_m2, search.domain_area_m2),
      fmt::format("{:.1f} m² cannot be seen (shaded)", search.unseen_area_m2()),
      fmt::format("{:.1f} m² are out of its reach", search.unreached_area_m2),
  };
}

Status RunPath(const PathArguments& arguments, const CommandEnvironment& environment) {
  CAIRN_RETURN_IF_ERROR(arguments.option_arguments.Apply());
  if (arguments.kind != "search" && arguments.to.empty()) {
    return MakeError(ErrorCode::kInvalidArgument, "--kind {} needs --to X,Y", arguments.kind);
  }
  if (arguments.kind == "search" && !arguments.to.empty()) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "--kind search ends where the last of the plan is seen; leave --to out");
  }
  if (arguments.kind != "search") {
    CAIRN_RETURN_IF_ERROR(arguments.option_arguments.RefuseGiven(
        {"max_num_places", "seen_ratio"}, "is for --kind search; leave it out, or change the kind"));
  }
  CAIRN_ASSIGN_OR_RETURN(
      const std::shared_ptr<const Views> opened,
      OpenViews(arguments.views, environment.num_threads, environment.memory_mib, *environment.progress));
  const Views& views = *opened;
  const PlanSpace space(views);
  const Vec2 from(arguments.from[0], arguments.from[1]);
  PlanPath path;
  ordered_json line = {{"kind", arguments.kind}};
  decompose_views::ViewsOverlay overlay;
  const Vec2 to = arguments.to.empty() ? from : Vec2(arguments.to[0], arguments.to[1]);
  if (arguments.kind == "search") {
    CAIRN_ASSIGN_OR_RETURN(SearchPath search, FindSearchPath(space, from, arguments.options));
    AddSearch(search, &line, &overlay);
    if (!search.unseen.empty()) {
      spdlog::info(
          "{:.1f} of {:.1f} m2 cannot be seen from where the robot gets to; the largest part, {:.1f} m2, "
          "is around ({:.2f}, {:.2f})",
          search.unseen_area_m2(), search.domain_area_m2, search.unseen[0].area_m2, search.unseen[0].at.x(),
          search.unseen[0].at.y());
    }
    path = std::move(search.path);
  } else if (arguments.kind == "min-link") {
    CAIRN_ASSIGN_OR_RETURN(MinimumLinkPath found, FindMinimumLinkPath(space, from, to, arguments.options));
    line["fewest_links"] = found.fewest_links;
    line["is_optimal"] = found.is_optimal();
    overlay.captions = {found.is_optimal()
                            ? "no path has fewer links"
                            : fmt::format("no path has fewer than {} links", found.fewest_links)};
    path = std::move(found.path);
  } else {
    CAIRN_ASSIGN_OR_RETURN(path, FindPath(space, from, to, arguments.options));
  }
  line["length_m"] = path.length_m;
  line["links"] = path.num_links();
  line["points"] = PathJson(path.points);
  *environment.out << JsonText(line) << "\n";
  environment.report->out = {{"links", path.num_links()}};
  if (arguments.svg.empty()) return Ok();
  overlay.captions.push_back(fmt::format("{:.1f} m, {} links", path.length_m, path.num_links()));
  overlay.paths = {path.points};
  return WriteFileAtomically(arguments.svg, decompose_views::DrawViews(views, overlay, /*regions=*/false));
}

struct ApartArguments {
  std::string views;
  std::vector<double> a, b;
  std::string svg;
  DisambiguateOptions options;
  OptionArguments option_arguments;
};

// Errors: InvalidArgument for a heading out of range; places are checked with the plan.
Result<PlanarPose> ParsePose(const std::string& option, const std::vector<double>& values) {
  if (!(std::abs(values[2]) <= 360)) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "{} {:g},{:g},{:g}: the heading must be in [-360, 360] degrees", option, values[0],
                     values[1], values[2]);
  }
  return PlanarPose{{values[0], values[1]}, RadFromDeg(values[2])};
}

const char* OutcomeName(DisambiguationOutcome outcome) {
  switch (outcome) {
    case DisambiguationOutcome::kFound:
      return "found";
    case DisambiguationOutcome::kAlike:
      return "alike";
    case DisambiguationOutcome::kGaveUp:
      return "gave_up";
  }
  return "";
}

std::string Caption(const DisambiguationPlan& plan) {
  switch (plan.outcome) {
    case DisambiguationOutcome::kFound:
      return fmt::format("case {}: {:.1f} m to go", plan.kind, plan.path_length_m);
    case DisambiguationOutcome::kAlike:
      return "nothing tells a from b";
    case DisambiguationOutcome::kGaveUp:
      return fmt::format("gave up after {} regions", plan.num_regions);
  }
  return "";
}

std::string Drawn(const Views& views, const PlanarPose& a, const PlanarPose& b,
                  const DisambiguationPlan& plan) {
  decompose_views::ViewsOverlay overlay;
  overlay.robots = {{a.position, a.heading_rad, "a"}, {b.position, b.heading_rad, "b"}};
  overlay.captions = {Caption(plan)};
  if (plan.kind > 0) {
    overlay.paths = {plan.path_a, plan.path_b};
    overlay.segments = {{plan.feature_start_a, plan.feature_end_a, plan.feature_is_at_a},
                        {plan.feature_start_b, plan.feature_end_b, !plan.feature_is_at_a}};
    overlay.captions.push_back(plan.feature_is_at_a ? "a wall seen from a only" : "a wall seen from b only");
  }
  return decompose_views::DrawViews(views, overlay, /*regions=*/false);
}

Status RunApart(const ApartArguments& arguments, const CommandEnvironment& environment) {
  CAIRN_RETURN_IF_ERROR(arguments.option_arguments.Apply());
  CAIRN_ASSIGN_OR_RETURN(const std::shared_ptr<const Views> opened, OpenPlan(arguments.views));
  const Views& views = *opened;
  CAIRN_ASSIGN_OR_RETURN(const PlanarPose a, ParsePose("--a", arguments.a));
  CAIRN_ASSIGN_OR_RETURN(const PlanarPose b, ParsePose("--b", arguments.b));
  CAIRN_ASSIGN_OR_RETURN(
      const DisambiguationPlan plan,
      views.num_faces() > 0 ? PlanDisambiguation(PlanSpace(views), a, b, arguments.options)
                            : PlanDisambiguation(views.plan, a, b, arguments.options, environment.num_threads,
                                                 environment.memory_mib, *environment.progress));
  ordered_json line = {
      {"outcome", OutcomeName(plan.outcome)}, {"case", plan.kind}, {"regions", plan.num_regions}};
  if (plan.kind > 0) {
    line["is_best"] = plan.is_best;
    line["length_m"] = plan.path_length_m;
    line["path_a"] = PathJson(plan.path_a);
    line["path_b"] = PathJson(plan.path_b);
    line["feature_at"] = plan.feature_is_at_a ? "a" : "b";
    line["feature_a"] = PathJson({plan.feature_start_a, plan.feature_end_a});
    line["feature_b"] = PathJson({plan.feature_start_b, plan.feature_end_b});
    line["distance_m"] = plan.distance_m;
  }
  *environment.out << JsonText(line) << "\n";
  if (!arguments.svg.empty())
    CAIRN_RETURN_IF_ERROR(WriteFileAtomically(arguments.svg, Drawn(views, a, b, plan)));
  if (plan.outcome != DisambiguationOutcome::kGaveUp) return Ok();
  return MakeError(ErrorCode::kFailed,
                   "gave up: nothing that distinguishes a from b is seen from the {} nearest regions, and "
                   "there are more; allow more with --max-num-regions",
                   plan.num_regions);
}

}  // namespace

Command PlanPathCommand() {
  auto arguments = std::make_shared<PathArguments>();
  Command command;
  command.name = "path";
  command.former_names = {"plan-path"};
  command.summary = "Plan a path: a short one, one with few turns, or one that sees everything";
  command.add_arguments = [arguments](ArgumentParser& parser) {
    parser.Add("views", arguments->views, "the plan (views.db, or a map that has it)")
        .Required()
        .Type("FILE");
    parser.Add("--from", arguments->from, "start, metres")
        .Required()
        .Values(2)
        .SeparatedByCommas()
        .Type("X,Y");
    parser.Add("--to", arguments->to, "goal, metres").Values(2).SeparatedByCommas().Type("X,Y");
    parser
        .Add("--kind", arguments->kind,
             "short, min-link (fewest turns) or search (sees all that can be seen)")
        .OneOf({"short", "min-link", "search"})
        .ShowDefault();
    parser.Add("--svg", arguments->svg, "also draw it").Type("FILE.svg");
    arguments->option_arguments.Add(parser, DescribeOptions(&arguments->options));
  };
  command.run = [arguments](const CommandEnvironment& environment) {
    return RunPath(*arguments, environment);
  };
  return command;
}

Command TellApartCommand() {
  auto arguments = std::make_shared<ApartArguments>();
  Command command;
  command.name = "tell-apart";
  command.summary = "Plan where to go to tell which of two poses is the right one";
  command.add_arguments = [arguments](ArgumentParser& parser) {
    parser.Add("views", arguments->views, "the plan (views.db, or a map that has it)")
        .Required()
        .Type("FILE");
    parser.Add("--a", arguments->a, "a pose, metres and degrees")
        .Required()
        .Values(3)
        .SeparatedByCommas()
        .Type("X,Y,DEG");
    parser.Add("--b", arguments->b, "another").Required().Values(3).SeparatedByCommas().Type("X,Y,DEG");
    parser.Add("--svg", arguments->svg, "also draw it").Type("FILE.svg");
    arguments->option_arguments.Add(parser, DescribeOptions(&arguments->options));
  };
  command.run = [arguments](const CommandEnvironment& environment) {
    return RunApart(*arguments, environment);
  };
  return command;
}

}  // namespace cairn::pipeline
