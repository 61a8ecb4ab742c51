#pragma once

#include <string>
#include <vector>

namespace cairn {

// The kinds of files that robots running ROS record into.
enum class BagStorage {
  kNone,
  kSqlite,  // ROS 2's .db3
  kMcap,    // ROS 2's .mcap
  kRos1,    // .bag
};

// What a file is by its first bytes; any SQLite file is kSqlite.  kNone for what cannot be read.
BagStorage BagStorageOf(const std::string& path);

// Whether it is to be read as a bag: a file that is called .db3, .mcap or .bag or begins as bags do (SQLite's
// with rosbag2's tables), or a folder with such names or rosbag2's metadata.yaml in it.  It need not be a
// whole one.  False for what cannot be read.
bool IsBag(const std::string& path);

// rosbag2's list of the files of a bag that is a folder, in that folder.
inline constexpr char kBagMetadataFile[] = "metadata.yaml";

// The files of a folder that are called .db3, .mcap or .bag, in natural order.
std::vector<std::string> BagsInFolder(const std::string& folder);

// The files whose change changes a bag: the file itself; of a folder metadata.yaml, if it is there, and
// BagsInFolder.
std::vector<std::string> FilesOfBag(const std::string& path);

}  // namespace cairn
