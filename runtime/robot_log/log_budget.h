#pragma once

#include <string>

namespace cairn {

// What a machine's clocks say.
struct MachineClocks {
  double wall_s = 0;    // since 1970; may jump
  double boot_s = 0;    // since the machine was started, asleep or not; does not jump
  std::string boot_id;  // another after each start
};
MachineClocks ReadMachineClocks();

// How many bytes may be written now, so that no 24 hours see more than a bound, however often a program is
// started: an amount that grows by half the bound in a day, up to half the bound.  While the machine runs,
// time is that since its start.  Across starts it is what the wall clock has advanced beyond the latest time
// that it ever showed: a clock that jumps to and fro gives nothing, one that jumps ahead at most a full
// amount, once.
struct LogBudget {
  double bytes = 0;    // that may be written
  double lived_s = 0;  // time that was counted so far
  double latest_wall_s = 0;
  double boot_s = 0;
  std::string boot_id;

  // A full amount.
  static LogBudget Begin(double max_bytes_per_day, const MachineClocks& now);
  // Adds what the time since the last call gives.
  void Advance(double max_bytes_per_day, const MachineClocks& now);
  // How full it is, in [0, 1].
  double Fill(double max_bytes_per_day) const;
};

}  // namespace cairn
