#include <algorithm>

#include "stages/decompose_regions/check_regions.h"
#include "stages/decompose_regions/command.h"

namespace cairn::decompose_regions {
namespace {

constexpr size_t kMaxShown = 20;

struct CheckArguments {
  std::string world;
  std::string regions;
  int max_hole = -1;
};

Status RunCheck(const CheckArguments& arguments, const CommandEnvironment& environment) {
  CAIRN_ASSIGN_OR_RETURN(const World world, ReadWorld(arguments.world));
  CAIRN_ASSIGN_OR_RETURN(const Decomposition decomposition, ReadDecomposition(arguments.regions));
  const RegionCheck check = CheckRegions(world, decomposition, arguments.max_hole);
  std::ostream& out = *environment.out;
  out << fmt::format("algorithm {}, k = {}, tau = {}, rho = {}: {}\n", decomposition.algorithm,
                     decomposition.k, decomposition.tau, decomposition.rho,
                     NumRegionsText(decomposition.regions.size(), decomposition.lower_bound));
  out << fmt::format("{} of {} coverable stations uncovered, largest connected hole {}\n",
                     check.num_uncovered, check.num_coverable, check.largest_hole);
  for (size_t i = 0; i < std::min(kMaxShown, check.violations.size()); ++i)
    out << check.violations[i] << "\n";
  if (check.violations.empty()) {
    out << "valid\n";
    return Ok();
  }
  return MakeError(ErrorCode::kFailed, "{}: {} properties fail, the first: {}", arguments.regions,
                   check.violations.size(), check.violations[0]);
}

}  // namespace

Command CheckRegionsCommand() {
  auto arguments = std::make_shared<CheckArguments>();
  Command command;
  command.name = "check-regions";
  command.summary = "Check a decomposition against its definition, and say which property fails";
  command.add_arguments = [arguments](ArgumentParser& parser) {
    parser.Add("world", arguments->world, "world: database or JSON").Required().Type("FILE");
    parser.Add("regions", arguments->regions, "regions: database or JSON").Required().Type("FILE");
    parser
        .Add("--max-hole", arguments->max_hole, "most connected uncovered stations that are allowed; -1: any")
        .Type("INT");
  };
  command.run = [arguments](const CommandEnvironment& environment) {
    return RunCheck(*arguments, environment);
  };
  return command;
}

}  // namespace cairn::decompose_regions
