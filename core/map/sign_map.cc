// Signing maps: the epoch is set, then the seal is made again over the changed file.
#include <algorithm>
#include <filesystem>

#include "core/files/database.h"
#include "core/files/replacement.h"
#include "core/map/map_file.h"
#include "core/map/map_head_tables.h"
#include "core/map/map_tables.h"
#include "core/seal/map_seal.h"

namespace cairn {
namespace {

// Hash of all that a robot reads when it opens the map, except the epoch.
Hash HashWithoutEpoch(StoredRows rows) {
  std::erase_if(rows.at("meta"), [](const StoredRow& row) {
    const Result<std::string> key = row.Text(0);
    return key.ok() && *key == "epoch";
  });
  return TablesHash(rows);
}

// Writes the epoch into a map file; returns the new root.  Nothing else may change.
Result<Hash> SetEpoch(const std::string& path, uint64_t epoch) {
  return WithDatabaseErrors(path, [&]() -> Result<Hash> {
    std::error_code error;
    const auto num_bytes = static_cast<int64_t>(std::filesystem::file_size(path, error));
    SQLite::Database database = OpenPrivate(path);
    Harden(database, num_bytes);
    database.exec("PRAGMA journal_mode = MEMORY; PRAGMA synchronous = OFF;");
    const StepLimit steps(database, MaxStepsFor(num_bytes));
    CAIRN_ASSIGN_OR_RETURN(const StoredRows before, ReadStoredRows(database, path, HeadTables(), num_bytes));
    SQLite::Statement insert(database, "INSERT OR REPLACE INTO meta VALUES (?, ?)");
    insert.bind(1, "epoch");
    insert.bind(2, std::to_string(epoch));
    insert.exec();
    CAIRN_ASSIGN_OR_RETURN(const StoredRows after, ReadStoredRows(database, path, HeadTables(), num_bytes));
    if (HashWithoutEpoch(before) != HashWithoutEpoch(after))
      return Corrupt(path, "its tables change when an epoch is written into them");
    CAIRN_RETURN_IF_ERROR(CheckPlainTable(database, path, "directory"));
    LimitedStatement directory(database, "SELECT entries FROM directory NOT INDEXED");
    if (!directory.executeStep()) return Corrupt(path, "table directory is empty");
    return RootHash(after, BlobView(directory.getColumn(0)));
  });
}

}  // namespace

Result<uint64_t> SignMap(const std::string& path, const SecretKey& key, const std::string& signed_path,
                         std::optional<uint64_t> epoch) {
  CAIRN_ASSIGN_OR_RETURN(const PublicKey public_key, PublicKeyOf(key));
  CAIRN_ASSIGN_OR_RETURN(const MapFile map, MapFile::Open(path, {}));
  CAIRN_RETURN_IF_ERROR(CheckFileHash(path));
  const uint64_t own_epoch = map.head().epoch;
  const uint64_t wanted = epoch.value_or(std::max<uint64_t>(own_epoch, 1));
  if (wanted == 0)
    return MakeError(ErrorCode::kInvalidArgument, "{}: epoch 0 means a map without an epoch; count from 1",
                     signed_path);
  CAIRN_ASSIGN_OR_RETURN(Replacement file, Replacement::Begin(signed_path));
  CAIRN_RETURN_IF_ERROR(file.CopyFrom(path));
  const std::string& copy = file.temporary();
  CAIRN_RETURN_IF_ERROR(CheckFileHash(copy));
  CAIRN_ASSIGN_OR_RETURN(const Seal copied, ReadSeal(copy));
  if (copied.file != map.seal().file)
    return MakeError(ErrorCode::kBusy, "{}: was changed while it was signed; sign it again", path);
  Hash root = copied.root;
  if (wanted != own_epoch) {
    CAIRN_ASSIGN_OR_RETURN(root, SetEpoch(copy, wanted));
  }
  CAIRN_RETURN_IF_ERROR(SignFile(copy, root, key));
  // As a robot sees it.
  CAIRN_ASSIGN_OR_RETURN(const MapFile made, MapFile::Open(copy, {.public_key = public_key}));
  CAIRN_RETURN_IF_ERROR(CheckFileHash(copy));
  if (made.head().epoch != wanted || made.head().name != map.head().name)
    return MakeError(ErrorCode::kFailed, "{}: what was signed is map '{}' of epoch {}; it is not written",
                     signed_path, made.head().name, made.head().epoch);
  CAIRN_RETURN_IF_ERROR(file.Finish());
  return wanted;
}

Status AddMapSignature(const std::string& path, const SecretKey& key, const std::string& signatures_path) {
  CAIRN_ASSIGN_OR_RETURN(const PublicKey public_key, PublicKeyOf(key));
  CAIRN_ASSIGN_OR_RETURN(const MapFile map, MapFile::Open(path, {}));
  if (!map.seal().is_signed()) {
    return MakeError(
        ErrorCode::kNotSigned,
        "{}: is not signed, and signatures are added to one in its seal, which sets its epoch; sign it "
        "first with `cairn sign MAP --key KEY -o SIGNED`",
        path);
  }
  if (map.seal().public_key == public_key) {
    return MakeError(ErrorCode::kInvalidArgument, "{}: has the signature of key {} in its seal already", path,
                     HexOf(public_key));
  }
  CAIRN_RETURN_IF_ERROR(CheckFileHash(path));
  CAIRN_ASSIGN_OR_RETURN(const Seal checked, ReadSeal(path));
  if (checked.file != map.seal().file)
    return MakeError(ErrorCode::kBusy, "{}: was changed while it was signed; sign it again", path);
  return AddSignature(SignedBytesOf(checked), key, signatures_path);
}

}  // namespace cairn
