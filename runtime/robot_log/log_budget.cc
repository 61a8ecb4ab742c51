#include "runtime/robot_log/log_budget.h"

#include <ctime>

#include <algorithm>

#include "core/files/file.h"

namespace cairn {
namespace {

constexpr double kSecondsADay = 86400;

double Seconds(clockid_t clock) {
  timespec time = {};
  clock_gettime(clock, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

double MostBytes(double max_bytes_per_day) { return max_bytes_per_day / 2; }

}  // namespace

MachineClocks ReadMachineClocks() {
  const auto boot_id = ReadFile("/proc/sys/kernel/random/boot_id");
  return {Seconds(CLOCK_REALTIME), Seconds(CLOCK_BOOTTIME), boot_id.ok() ? *boot_id : ""};
}

LogBudget LogBudget::Begin(double max_bytes_per_day, const MachineClocks& now) {
  return {.bytes = MostBytes(max_bytes_per_day),
          .latest_wall_s = now.wall_s,
          .boot_s = now.boot_s,
          .boot_id = now.boot_id};
}

void LogBudget::Advance(double max_bytes_per_day, const MachineClocks& now) {
  const bool is_same_start = now.boot_id == boot_id && now.boot_s >= boot_s;
  const double elapsed_s = is_same_start ? now.boot_s - boot_s : std::max(0.0, now.wall_s - latest_wall_s);
  const double most = MostBytes(max_bytes_per_day);
  bytes = std::clamp(bytes + most * elapsed_s / kSecondsADay, 0.0, most);
  lived_s += elapsed_s;
  latest_wall_s = std::max(latest_wall_s, now.wall_s);
  boot_s = now.boot_s;
  boot_id = now.boot_id;
}

double LogBudget::Fill(double max_bytes_per_day) const {
  return std::clamp(bytes / MostBytes(max_bytes_per_day), 0.0, 1.0);
}

}  // namespace cairn
