// Flips single bits of a map, one after the other, and opens it:  flip_bits MAP NUM_FLIPS Counts flips that
// `cairn verify`'s checks do not find (there must be none), and the loader's message for each.
#include <cstdio>
#include <cstdlib>
#include <map>
#include <string>

#include <unistd.h>

#include "bench/runtime/some_features.h"
#include "core/base/random.h"
#include "core/files/file.h"
#include "core/map/map_file.h"
#include "core/seal/map_seal.h"
#include "runtime/localize/localizer.h"

namespace cairn {
namespace {

Status Verify(const std::string& path) {
  CAIRN_RETURN_IF_ERROR(MapFile::Open(path, {}));
  return CheckFileHash(path);
}

Status FlipBits(const std::string& map_path, int num_flips) {
  CAIRN_ASSIGN_OR_RETURN(const std::string bytes, ReadFile(map_path));
  CAIRN_ASSIGN_OR_RETURN(const auto whole, Map::Open(map_path));
  const Camera camera = whole->head().cameras.front();
  const Features features = SomeFeatures(camera);
  const std::string path = "/dev/shm/flip_bits_" + std::to_string(getpid());
  std::FILE* const file = std::fopen(path.c_str(), "w+b");
  if (file == nullptr) return MakeError(ErrorCode::kIo, "{}: cannot be written", path);
  std::fwrite(bytes.data(), 1, bytes.size(), file);
  std::fflush(file);
  const auto write = [&](size_t place, char byte) {
    std::fseek(file, static_cast<long>(place), SEEK_SET);
    std::fputc(byte, file);
    std::fflush(file);
  };
  CAIRN_RETURN_IF_ERROR(Verify(path));
  Random random(3);
  int num_missed = 0;
  std::map<std::string, int> counts;  // what the loader said
  for (int i = 0; i < num_flips; ++i) {
    const auto bit = static_cast<size_t>(random.UniformInt(0, static_cast<int64_t>(8 * bytes.size()) - 1));
    write(bit / 8, static_cast<char>(bytes[bit / 8] ^ (1 << bit % 8)));
    if (Verify(path).ok()) {
      ++num_missed;
      std::printf("bit %zu is not found\n", bit);
    }
    const auto map = Map::Open(path);
    if (!map.ok()) {
      ++counts[std::string("not opened: ") + ErrorCodeName(map.error().code)];
    } else {
      const auto found = Localizer(*map).LocalizeFeatures(features, camera);
      ++counts[found.ok() ? "not touched by the query"
                          : std::string("query: ") + ErrorCodeName(found.error().code)];
    }
    write(bit / 8, bytes[bit / 8]);
  }
  std::fclose(file);
  std::remove(path.c_str());
  std::printf("%d flips of a map of %zu bytes, %d not found\n", num_flips, bytes.size(), num_missed);
  for (const auto& [what, count] : counts) std::printf("%8d %s\n", count, what.c_str());
  return num_missed == 0 ? Ok() : MakeError(ErrorCode::kFailed, "{} flips were not found", num_missed);
}

}  // namespace
}  // namespace cairn

int main(int argc, char** argv) {
  if (argc != 3) return std::fprintf(stderr, "usage: flip_bits MAP NUM_FLIPS\n"), 2;
  const cairn::Status status = cairn::FlipBits(argv[1], std::atoi(argv[2]));
  if (!status.ok()) std::fprintf(stderr, "%s\n", status.error().message.c_str());
  return status.ok() ? 0 : 1;
}
