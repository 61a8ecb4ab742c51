#pragma once

#include <cstdint>
#include <map>
#include <random>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "tests/recorded/recorded_call.h"

namespace cairn {

// A call of record_calls.cc, with its paths or bytes.
struct DiskCall : RecordedCall {
  std::string path, other;
};

// All calls of a log.
std::vector<DiskCall> ReadDiskCalls(const std::string& log);

// What a disk may hold after a power cut, in a folder that was whole, and synced, before the first of some
// calls.  A file has what was written to it before its last sync, and of what was written afterwards nothing,
// all or anything; a folder has its names as of its last sync, and of the changes since then none, all or any
// (POSIX assures no more; ext4, XFS and Btrfs keep the changes of names in order).  A change that involves
// two folders is sure when both are synced.  After "All File Systems Are Not Created Equal", Pillai et al.
// 2014, section 3.
class PowerCut {
 public:
  // What is kept of what is not synced.
  enum class Names { kNone, kFirst, kSome, kAll };  // kFirst: those before a random one
  enum class Bytes { kNone, kSome, kAll };          // kSome: random writes, and random parts of them

  // Reads what is in `folder` (all links resolved) now.
  explicit PowerCut(const std::string& folder);

  // Does one call more.
  void Do(const DiskCall& call);

  // Path in the folder -> bytes, and date since 1970 in ns.  Folders end with "/".
  struct File {
    std::string bytes;
    int64_t date_ns = 0;
    bool operator==(const File&) const = default;
  };
  using Files = std::map<std::string, File>;
  Files Left(Names names, Bytes bytes, std::mt19937* random) const;

 private:
  struct Write {
    bool is_truncation = false;
    int64_t offset = 0, date_ns = 0;
    std::string bytes;
  };
  struct Node {
    bool is_folder = false;
    File synced;                     // of a file
    std::vector<Write> since;        // of a file
    std::map<std::string, int> now;  // of a folder: name -> node
  };
  // A name of a folder leads to a node, or -1: to none.
  struct Entry {
    int folder;
    std::string name;
    int node;
  };
  // A change of names that is done whole or not at all.
  struct Change {
    std::vector<Entry> entries;
    std::set<int> unsynced;  // folders
  };
  struct Place {
    int folder;
    std::string name;
  };

  int Add(bool is_folder);
  void Read(const std::string& path, int folder);
  Place PlaceOf(const std::string& path) const;
  int NodeOf(const std::string& path) const;
  void Apply(std::vector<Entry> entries);
  void Sync(int node);
  static void WriteTo(const Write& write, File* file);
  File LeftOf(const Node& node, Bytes bytes, std::mt19937* random) const;

  std::string folder_;
  std::vector<Node> nodes_;
  std::vector<std::map<std::string, int>> at_first_;  // of the nodes that there were
  std::vector<Change> changes_;
  std::map<uint64_t, int> nodes_of_inodes_;
};

// Makes a folder that has these files and no others.
void WriteFiles(const PowerCut::Files& files, const std::string& folder);

}  // namespace cairn
