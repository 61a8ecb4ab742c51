#include "stages/reconstruct/by_colmap/run_program.h"

#include <fcntl.h>
#include <poll.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstring>
#include <thread>

#include "core/line/child_environment.h"

namespace cairn::reconstruct {
namespace {

using Clock = std::chrono::steady_clock;
constexpr int kPollMs = 100;
constexpr auto kGrace = std::chrono::seconds(2);

double SecondsSince(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

// Divides the output into lines and keeps the last ones.
class LineReader {
 public:
  LineReader(const RunProgramOptions& options, std::vector<std::string>* last_lines)
      : options_(options), last_lines_(last_lines) {}

  void Add(const char* text, ssize_t size) {
    for (ssize_t i = 0; i < size; ++i) {
      if (text[i] == '\n' || text[i] == '\r') {
        End();
      } else {
        line_ += text[i];
      }
    }
  }
  void End() {
    if (line_.find_first_not_of(" \t=") != std::string::npos) {
      last_lines_->push_back(line_);
      if (static_cast<int>(last_lines_->size()) > options_.num_last_lines)
        last_lines_->erase(last_lines_->begin());
      if (options_.on_line) options_.on_line(line_);
    }
    line_.clear();
  }

 private:
  const RunProgramOptions& options_;
  std::vector<std::string>* last_lines_;
  std::string line_;
};

// Whether the process has ended.  Does not reap it, so that its group's number is not used again.
bool HasEnded(pid_t pid) {
  siginfo_t state = {};
  return waitid(P_PID, pid, &state, WEXITED | WNOHANG | WNOWAIT) == 0 && state.si_pid == pid;
}

void EndGroup(pid_t pid) {
  kill(-pid, SIGTERM);
  const auto start = Clock::now();
  while (!HasEnded(pid) && Clock::now() - start < kGrace)
    std::this_thread::sleep_for(std::chrono::milliseconds(kPollMs / 4));
  kill(-pid, SIGKILL);
}

// Starts the program with both outputs in `write_fd`.
Result<pid_t> Spawn(const std::vector<std::string>& words, const std::vector<std::string>& environment,
                    int write_fd) {
  std::vector<char*> argv, envp;
  for (const std::string& word : words) argv.push_back(const_cast<char*>(word.c_str()));
  argv.push_back(nullptr);
  const std::vector<std::string> entries = ChildEnvironment(environment);
  for (const std::string& entry : entries) envp.push_back(const_cast<char*>(entry.c_str()));
  envp.push_back(nullptr);

  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_adddup2(&actions, write_fd, STDOUT_FILENO);
  posix_spawn_file_actions_adddup2(&actions, write_fd, STDERR_FILENO);
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP);
  posix_spawnattr_setpgroup(&attributes, 0);
  pid_t pid = 0;
  const int reason = posix_spawnp(&pid, argv[0], &actions, &attributes, argv.data(), envp.data());
  posix_spawnattr_destroy(&attributes);
  posix_spawn_file_actions_destroy(&actions);
  if (reason == 0) return pid;
  return MakeError(reason == ENOENT ? ErrorCode::kNotFound : ErrorCode::kIo, "{}: cannot be started: {}",
                   words[0], std::strerror(reason));
}

// Reads until the process has ended and all its output is read, or it has to be ended; returns whether it
// has ended.
bool ReadUntilEnd(pid_t pid, int read_fd, const Progress& progress, double max_seconds, LineReader* lines,
                  bool* timed_out) {
  const auto start = Clock::now();
  char block[4096];
  for (bool is_open = true;;) {
    *timed_out = max_seconds > 0 && SecondsSince(start) > max_seconds;
    if (*timed_out || progress.Cancelled()) return false;
    pollfd readable = {.fd = is_open ? read_fd : -1, .events = POLLIN, .revents = 0};
    if (poll(&readable, 1, kPollMs) > 0) {
      const ssize_t size = read(read_fd, block, sizeof(block));
      is_open = size != 0;
      lines->Add(block, size);
    } else if (HasEnded(pid)) {
      return true;  // its child processes may still keep its outputs open
    }
  }
}

}  // namespace

Result<ProgramOutcome> RunProgram(const std::vector<std::string>& words, const RunProgramOptions& options,
                                  const Progress& progress) {
  int ends[2];
  if (pipe2(ends, O_CLOEXEC) != 0)
    return MakeError(ErrorCode::kIo, "{}: no pipe for its output: {}", words[0], std::strerror(errno));
  const Result<pid_t> pid = Spawn(words, options.environment, ends[1]);
  close(ends[1]);
  if (!pid.ok()) {
    close(ends[0]);
    return pid.error();
  }
  ProgramOutcome outcome;
  LineReader lines(options, &outcome.last_lines);
  const bool has_ended =
      ReadUntilEnd(*pid, ends[0], progress, options.max_seconds, &lines, &outcome.timed_out);
  lines.End();
  close(ends[0]);
  if (!has_ended) EndGroup(*pid);
  int status = 0;
  while (waitpid(*pid, &status, 0) < 0 && errno == EINTR) {
  }
  if (!has_ended && !outcome.timed_out)
    return MakeError(ErrorCode::kCancelled, "stopped while {} was running", words[0]);
  outcome.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  return outcome;
}

}  // namespace cairn::reconstruct
