#include "pipeline/commands/commands.h"

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <spdlog/spdlog.h>

#include "core/capture/join_captures.h"

namespace cairn::pipeline {
namespace {

struct JoinArguments {
  std::vector<std::string> captures;  // "NAME=FOLDER"
  std::vector<std::string> queries;   // "NAME=FILE"
  std::vector<std::string> registered;
  std::string output;
};

Result<std::pair<std::string, std::string>> SplitAtEquals(const std::string& text, const char* form) {
  const size_t equals = text.find('=');
  if (equals == 0 || equals == std::string::npos || equals + 1 == text.size())
    return MakeError(ErrorCode::kInvalidArgument, "'{}': expected {}", text, form);
  return std::pair(text.substr(0, equals), text.substr(equals + 1));
}

Status RunJoin(const JoinArguments& arguments, const CommandEnvironment& environment) {
  std::vector<CaptureSession> sessions;
  for (const std::string& text : arguments.captures) {
    CAIRN_ASSIGN_OR_RETURN(const auto session, SplitAtEquals(text, "NAME=FOLDER"));
    sessions.push_back({.name = session.first, .root = session.second});
  }
  const auto find = [&](const std::string& option, const std::string& name) -> Result<CaptureSession*> {
    for (CaptureSession& session : sessions) {
      if (session.name == name) return &session;
    }
    return MakeError(ErrorCode::kInvalidArgument, "{}: no capture is named '{}'", option, name);
  };
  for (const std::string& text : arguments.queries) {
    CAIRN_ASSIGN_OR_RETURN(const auto queries, SplitAtEquals(text, "NAME=FILE"));
    CAIRN_ASSIGN_OR_RETURN(CaptureSession* const session, find("--queries " + text, queries.first));
    session->queries_path = queries.second;
  }
  for (const std::string& name : arguments.registered) {
    CAIRN_ASSIGN_OR_RETURN(CaptureSession* const session, find("--register " + name, name));
    session->is_registered = true;
  }
  CAIRN_ASSIGN_OR_RETURN(const JoinedCapture joined, JoinCaptures(sessions, arguments.output));
  for (const std::string& warning : joined.warnings) spdlog::warn("{}", warning);
  environment.report->in = {{"sessions", static_cast<int64_t>(sessions.size())}};
  environment.report->out = {{"images", joined.num_images}, {"queries", joined.num_queries}};
  std::string counts = "without poses";
  if (joined.num_images > 0) {
    counts = fmt::format("{} images, {} queries, {} cameras", joined.num_images, joined.num_queries,
                         joined.num_cameras);
  }
  if (joined.num_registered > 0)
    counts += fmt::format("; {} to be registered to the others", joined.num_registered);
  *environment.out << fmt::format("join_captures: {} sessions, {}\n", sessions.size(), counts);
  return Ok();
}

}  // namespace

Command JoinCommand() {
  const auto arguments = std::make_shared<JoinArguments>();
  return {
      .name = "join",
      .summary = "Join surveys of a place into one capture, without copying images",
      .add_arguments =
          [arguments](ArgumentParser& parser) {
            parser.Add("captures", arguments->captures, "Session's name and capture folder, once per session")
                .Required()
                .Type("NAME=FOLDER");
            parser
                .Add("--queries", arguments->queries,
                     "Held-out images of a session [its capture's queries.txt]")
                .Type("NAME=FILE");
            parser
                .Add("--register", arguments->registered,
                     "Session whose poses are in a frame of its own; those without poses, beside others that "
                     "have some, "
                     "are registered anyway")
                .Type("NAME");
            parser.Add("-o,--output", arguments->output, "Capture folder to write").Required().Type("FOLDER");
          },
      .run = [arguments](const CommandEnvironment& environment) { return RunJoin(*arguments, environment); },
      .stage = "join_captures",
      .former_names = {"join-captures"}};
}

}  // namespace cairn::pipeline
