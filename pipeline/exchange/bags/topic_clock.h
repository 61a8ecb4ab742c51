#pragma once

#include <algorithm>
#include <cstdint>
#include <string>
#include <vector>

#include "pipeline/exchange/bags/files/bag_bytes.h"

namespace cairn::pipeline {

// From the first of some times to the last.
struct TimeSpan {
  int64_t first_ns = 0, last_ns = 0;
  bool is_empty = true;
  void Add(int64_t time_ns) {
    first_ns = is_empty ? time_ns : std::min(first_ns, time_ns);
    last_ns = is_empty ? time_ns : std::max(last_ns, time_ns);
    is_empty = false;
  }
  bool Meets(const TimeSpan& other) const {
    return !is_empty && !other.is_empty && first_ns <= other.last_ns && other.first_ns <= last_ns;
  }
  std::string Text() const;  // "5.000 to 6.000 s"
};

// What the stamps of one source are, seen from the times at which its messages were recorded: of a topic's
// headers, or of a frame's transforms, as several programs send to /tf.  A clock is right or wrong by the
// same for all messages, but for the delay of recording; a stamp far from that is none that the clock gave (a
// driver's first message, a counter that ran over).
class TopicClock {
 public:
  // Of a message; stamp 0: not set.
  void Add(int64_t stamp_ns, int64_t record_time_ns);
  // REQUIRES: once, after the last Add and before what follows.
  void Finish();

  // Whether a stamp is farther from the median than 10 s and ten times as far as the median stamp: where
  // recording times say nothing (a bag that was converted), all stamps count.
  bool IsWild(int64_t stamp_ns, int64_t record_time_ns) const;
  // The stamp; without one, or with a wild one, the time of recording as the source's clock shows it.
  int64_t TimeOf(int64_t stamp_ns, int64_t record_time_ns) const;

  int64_t ahead_ns() const { return ahead_ns_; }    // of the times of recording: the median
  int64_t spread_ns() const { return spread_ns_; }  // median distance from that
  const TimeSpan& recorded() const { return recorded_; }

 private:
  std::vector<int64_t> aheads_ns_;
  int64_t ahead_ns_ = 0, spread_ns_ = 0;
  TimeSpan recorded_;
};

// What is to be added to times of `other` for them to be times of `clock`: 0 where both are of one clock
// (seen from when messages were recorded they are less than 5 s apart), and where the times of recording do
// not say (they follow stamps worse than to 0.2 s, as of a bag that was converted, or are not of one time).
int64_t ShiftToClock(const TopicClock& clock, const TopicClock& other);

// The times of a source's messages by the images' clock.
class SourceTimes {
 public:
  SourceTimes() = default;
  SourceTimes(TopicClock clock, int64_t shift_ns) : clock_(std::move(clock)), shift_ns_(shift_ns) {}

  // Of a message; what its clock did not give is counted.
  int64_t Take(int64_t stamp_ns, int64_t record_time_ns);

  int64_t shift_ns() const { return shift_ns_; }
  // Of those taken.
  bool has_taken() const { return has_taken_; }
  // One or two sentences' ends, of "images of /i" for instance: what had no stamp, and what had a wild one.
  std::vector<std::string> Warnings(const std::string& things) const;

 private:
  TopicClock clock_;
  int64_t shift_ns_ = 0;
  bool has_taken_ = false;
  PassedOver unstamped_, wild_;
};

}  // namespace cairn::pipeline
