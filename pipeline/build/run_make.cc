#include "pipeline/build/run_make.h"

#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstring>
#include <thread>
#include <utility>

#include "core/line/child_environment.h"
#include "core/modules/program_files.h"

namespace cairn::pipeline {

Result<std::string> RulesPath(const std::string& program) {
  return InstalledPath(program, "share/cairn/map.mk");
}

Result<std::vector<std::string>> MakeWords(const std::string& rules, const std::string& build_dir,
                                           const std::string& program, const std::string& goal,
                                           const CommandEnvironment& environment,
                                           const std::string& progress_style, MakeVariables variables) {
  CAIRN_RETURN_IF_ERROR(CheckMakePath("the file of rules", rules));
  CAIRN_RETURN_IF_ERROR(CheckMakePath("the file to make", goal));
  CAIRN_RETURN_IF_ERROR(variables.Set("BUILD", "the build folder", {build_dir}));
  CAIRN_RETURN_IF_ERROR(variables.Set("CAIRN", "the program", {program}));
  CAIRN_RETURN_IF_ERROR(variables.Set("THREADS", "--threads", {std::to_string(environment.num_threads)}));
  CAIRN_RETURN_IF_ERROR(variables.Set("PROGRESS", "--progress", {progress_style}));
  CAIRN_RETURN_IF_ERROR(variables.Set("LOG_LEVEL", "--log-level", {environment.log_level}));
  std::vector<std::string> words = {"make", "--silent", "--no-print-directory", "--no-builtin-rules",
                                    "--file=" + rules};
  for (std::string& word : variables.CommandWords()) words.push_back(std::move(word));
  words.push_back(goal);
  return words;
}

Result<int> RunProgramAndWait(const std::vector<std::string>& words, const std::string& variable,
                              const Progress& progress) {
  const std::vector<std::string> environment = ChildEnvironment({variable});
  std::vector<char*> argv, envp;
  for (const std::string& word : words) argv.push_back(const_cast<char*>(word.c_str()));
  argv.push_back(nullptr);
  for (const std::string& entry : environment) envp.push_back(const_cast<char*>(entry.c_str()));
  envp.push_back(nullptr);
  pid_t pid = 0;
  const int reason = posix_spawnp(&pid, argv[0], nullptr, nullptr, argv.data(), envp.data());
  if (reason != 0) {
    return MakeError(ErrorCode::kNotFound, "{}: cannot be started: {}; install GNU Make", words[0],
                     std::strerror(reason));
  }
  int wait_status = 0;
  bool is_told = false;
  while (true) {
    const pid_t ended = waitpid(pid, &wait_status, WNOHANG);
    if (ended == pid) return wait_status;
    if (ended < 0 && errno != EINTR)
      return MakeError(ErrorCode::kFailed, "waiting for {}: {}", words[0], std::strerror(errno));
    if (progress.Cancelled() && !std::exchange(is_told, true)) kill(pid, SIGTERM);
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
}

}  // namespace cairn::pipeline
