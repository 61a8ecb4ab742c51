#include "tests/end_to_end/power_cut.h"

#include <fcntl.h>
#include <sys/stat.h>

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <fstream>

#include <gtest/gtest.h>

#include "core/files/file.h"

namespace cairn {

namespace fs = std::filesystem;

std::vector<DiskCall> ReadDiskCalls(const std::string& log) {
  const std::string bytes = ReadFile(log).value();
  std::vector<DiskCall> calls;
  for (size_t at = 0; at < bytes.size();) {
    DiskCall call;
    std::memcpy(static_cast<RecordedCall*>(&call), bytes.data() + at, sizeof(RecordedCall));
    at += sizeof(RecordedCall);
    call.path = bytes.substr(at, call.path_bytes);
    call.other = bytes.substr(at + call.path_bytes, call.other_bytes);
    at += call.path_bytes + call.other_bytes;
    calls.push_back(std::move(call));
  }
  return calls;
}

PowerCut::PowerCut(const std::string& folder) : folder_(folder) {
  Read(folder, Add(/*is_folder=*/true));
  for (const Node& node : nodes_) at_first_.push_back(node.now);
}

int PowerCut::Add(bool is_folder) {
  nodes_.push_back({.is_folder = is_folder});
  return static_cast<int>(nodes_.size()) - 1;
}

void PowerCut::Read(const std::string& path, int folder) {
  for (const fs::directory_entry& entry : fs::directory_iterator(path)) {
    const int node = Add(entry.is_directory());
    nodes_[folder].now[entry.path().filename().string()] = node;
    if (entry.is_directory()) {
      Read(entry.path().string(), node);
      continue;
    }
    struct stat status = {};
    ASSERT_EQ(stat(entry.path().c_str(), &status), 0);
    nodes_[node].synced = {ReadFile(entry.path().string()).value(),
                           status.st_mtim.tv_sec * int64_t{1000000000} + status.st_mtim.tv_nsec};
    nodes_of_inodes_[status.st_ino] = node;
  }
}

PowerCut::Place PowerCut::PlaceOf(const std::string& path) const {
  int folder = 0;
  std::string name;
  for (const fs::path& part : fs::path(path).lexically_relative(folder_)) {
    if (!name.empty()) folder = nodes_[folder].now.at(name);
    name = part.string();
  }
  return {folder, name};
}

int PowerCut::NodeOf(const std::string& path) const {
  if (path == folder_) return 0;
  const Place place = PlaceOf(path);
  const auto found = nodes_[place.folder].now.find(place.name);
  return found == nodes_[place.folder].now.end() ? -1 : found->second;
}

void PowerCut::Apply(std::vector<Entry> entries) {
  Change change{.entries = std::move(entries)};
  for (const Entry& entry : change.entries) {
    if (entry.node < 0) {
      nodes_[entry.folder].now.erase(entry.name);
    } else {
      nodes_[entry.folder].now[entry.name] = entry.node;
    }
    change.unsynced.insert(entry.folder);
  }
  changes_.push_back(std::move(change));
}

void PowerCut::Sync(int node) {
  if (nodes_[node].is_folder) {
    for (Change& change : changes_) change.unsynced.erase(node);
    return;
  }
  for (const Write& write : nodes_[node].since) WriteTo(write, &nodes_[node].synced);
  nodes_[node].since.clear();
}

void PowerCut::Do(const DiskCall& call) {
  const auto write = [&](Write what) {
    nodes_[nodes_of_inodes_.at(call.inode)].since.push_back(std::move(what));
  };
  switch (call.kind) {
    case RecordedCall::kOpen: {
      const Place place = PlaceOf(call.path);
      int node = NodeOf(call.path);
      if (call.offset == 1 || node < 0) {
        node = Add(/*is_folder=*/false);
        nodes_[node].synced.date_ns = call.date_ns;
        Apply({{place.folder, place.name, node}});
      }
      nodes_of_inodes_[call.inode] = node;
      if (call.offset == 2) write({.is_truncation = true, .date_ns = call.date_ns});
      break;
    }
    case RecordedCall::kWrite:
      write({.offset = call.offset, .date_ns = call.date_ns, .bytes = call.other});
      break;
    case RecordedCall::kTruncate:
      write({.is_truncation = true, .offset = call.offset, .date_ns = call.date_ns});
      break;
    case RecordedCall::kSetDate:
      if (call.path.empty() && call.offset >= 0) write({.date_ns = call.offset});
      break;
    case RecordedCall::kSync:
      Sync(call.path.empty() ? nodes_of_inodes_.at(call.inode) : NodeOf(call.path));
      break;
    case RecordedCall::kSyncAll:
      for (size_t node = 0; node < nodes_.size(); ++node) Sync(static_cast<int>(node));
      break;
    case RecordedCall::kRename:
    case RecordedCall::kExchange:
    case RecordedCall::kLink: {
      const Place from = PlaceOf(call.path), to = PlaceOf(call.other);
      const int moved = NodeOf(call.path);
      std::vector<Entry> entries = {{to.folder, to.name, moved}};
      if (call.kind == RecordedCall::kExchange)
        entries.push_back({from.folder, from.name, NodeOf(call.other)});
      if (call.kind == RecordedCall::kRename) entries.insert(entries.begin(), {from.folder, from.name, -1});
      Apply(std::move(entries));
      break;
    }
    case RecordedCall::kUnlink: {
      const Place place = PlaceOf(call.path);
      Apply({{place.folder, place.name, -1}});
      break;
    }
    case RecordedCall::kMakeFolder: {
      const Place place = PlaceOf(call.path);
      Apply({{place.folder, place.name, Add(/*is_folder=*/true)}});
      break;
    }
  }
}

void PowerCut::WriteTo(const Write& write, File* file) {
  file->date_ns = write.date_ns;
  if (write.is_truncation) {
    file->bytes.resize(static_cast<size_t>(write.offset));
  } else if (!write.bytes.empty()) {
    const size_t end = static_cast<size_t>(write.offset) + write.bytes.size();
    if (file->bytes.size() < end) file->bytes.resize(end);
    file->bytes.replace(static_cast<size_t>(write.offset), write.bytes.size(), write.bytes);
  }
}

PowerCut::File PowerCut::LeftOf(const Node& node, Bytes bytes, std::mt19937* random) const {
  File file = node.synced;
  for (const Write& write : node.since) {
    if (bytes == Bytes::kAll) {
      WriteTo(write, &file);
    } else if (bytes == Bytes::kSome && (*random)() % 2 == 0) {
      Write part = write;
      if (!part.bytes.empty() && (*random)() % 4 == 0) part.bytes.resize((*random)() % part.bytes.size());
      WriteTo(part, &file);
    }
  }
  return file;
}

PowerCut::Files PowerCut::Left(Names names, Bytes bytes, std::mt19937* random) const {
  std::vector<std::map<std::string, int>> folders = at_first_;
  folders.resize(nodes_.size());
  const auto num_unsynced = static_cast<size_t>(std::count_if(
      changes_.begin(), changes_.end(), [](const Change& each) { return !each.unsynced.empty(); }));
  size_t num_kept = names == Names::kAll ? num_unsynced : 0;
  if (names == Names::kFirst) num_kept = (*random)() % (num_unsynced + 1);
  for (const Change& change : changes_) {
    if (!change.unsynced.empty()) {
      const bool is_kept = names == Names::kSome ? (*random)() % 2 == 0 : num_kept > 0;
      if (num_kept > 0) --num_kept;
      if (!is_kept) continue;
    }
    for (const Entry& entry : change.entries) {
      if (entry.node < 0) {
        folders[entry.folder].erase(entry.name);
      } else {
        folders[entry.folder][entry.name] = entry.node;
      }
    }
  }
  Files files;
  std::vector<std::pair<std::string, int>> waiting = {{"", 0}};
  while (!waiting.empty()) {
    const auto [path, folder] = waiting.back();
    waiting.pop_back();
    if (folder != 0) files[path] = {};
    for (const auto& [name, node] : folders[folder]) {
      if (nodes_[node].is_folder) {
        waiting.emplace_back(path + name + "/", node);
      } else {
        files[path + name] = LeftOf(nodes_[node], bytes, random);
      }
    }
  }
  return files;
}

void WriteFiles(const PowerCut::Files& files, const std::string& folder) {
  fs::remove_all(folder);
  fs::create_directories(folder);
  for (const auto& [name, file] : files) {
    const std::string path = folder + "/" + name;
    if (name.ends_with("/")) {
      fs::create_directories(path);
      continue;
    }
    std::ofstream(path, std::ios::binary) << file.bytes;
    const timespec date = {file.date_ns / 1000000000, file.date_ns % 1000000000};
    const timespec dates[2] = {date, date};
    EXPECT_EQ(utimensat(AT_FDCWD, path.c_str(), dates, 0), 0) << path;
  }
}

}  // namespace cairn
