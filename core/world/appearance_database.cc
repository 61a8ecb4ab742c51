#include "core/world/appearance.h"

#include <algorithm>

#include "core/files/database.h"
#include "schemas/appearance_sql.h"

namespace cairn {
namespace {

constexpr int kAppearanceApplicationId = 0x63726167;
constexpr int kAppearanceVersion = 2;

void WriteComponents(SQLite::Database& database, const Appearance& appearance) {
  std::vector<int> num_nodes(appearance.NumComponents(), 0), num_kept(appearance.NumComponents(), 0);
  for (const AppearanceNode& node : appearance.nodes) {
    ++num_nodes[node.component];
    num_kept[node.component] += node.role != NodeRole::kDropped;
  }
  SQLite::Statement row(database, "INSERT INTO components VALUES (?, ?, ?, ?)");
  for (int i = 0; i < appearance.NumComponents(); ++i) {
    row.bind(1, i);
    row.bind(2, num_nodes[i]);
    row.bind(3, num_kept[i]);
    if (appearance.lower_bounds[i] > 0) row.bind(4, appearance.lower_bounds[i]);
    row.exec();
    row.reset();
    row.clearBindings();
  }
}

void WriteNodes(SQLite::Database& database, const Appearance& appearance) {
  SQLite::Statement row(database, "INSERT INTO nodes VALUES (?, ?, ?, ?, ?, ?, ?)");
  std::vector<NodeIdx> neighbours;
  std::vector<int32_t> num_inliers;
  for (size_t i = 0; i < appearance.nodes.size(); ++i) {
    const AppearanceNode& node = appearance.nodes[i];
    neighbours.clear();
    num_inliers.clear();
    for (const AppearanceGraph::Neighbour& n : appearance.graph.Neighbours(static_cast<NodeIdx>(i))) {
      if (n.node < static_cast<NodeIdx>(i)) continue;
      neighbours.push_back(n.node);
      num_inliers.push_back(n.num_inliers);
    }
    row.bind(1, static_cast<int64_t>(i));
    row.bind(2, node.component);
    row.bind(3, static_cast<int>(node.role));
    BindVector(row, 4, node.images);
    BindVector(row, 5, neighbours);
    BindVector(row, 6, num_inliers);
    if (node.entropy) row.bind(7, Thousandths(*node.entropy));
    row.exec();
    row.reset();
    row.clearBindings();
  }
}

void WriteConfusable(SQLite::Database& database, const Appearance& appearance) {
  SQLite::Statement row(database, "INSERT INTO confusable VALUES (?, ?, ?)");
  for (const ConfusablePair& pair : appearance.confusable) {
    row.bind(1, pair.node1);
    row.bind(2, pair.node2);
    row.bind(3, Thousandths(pair.score));
    row.exec();
    row.reset();
  }
}

Status ReadConfusable(SQLite::Database& database, const std::string& path, Appearance* appearance) {
  LimitedStatement rows(database, "SELECT node1, node2, score FROM confusable ORDER BY node1, node2");
  const auto num_nodes = static_cast<int64_t>(appearance->nodes.size());
  while (rows.executeStep()) {
    const int64_t node1 = rows.getColumn(0).getInt64(), node2 = rows.getColumn(1).getInt64(),
                  score = rows.getColumn(2).getInt64();
    if (node1 < 0 || node2 <= node1 || node2 >= num_nodes || score <= 0 || score > Thousandths(1)) {
      return MakeError(ErrorCode::kCorrupt,
                       "{}: table confusable: nodes {} and {} of {} with a score of {} thousandths", path,
                       node1, node2, num_nodes, score);
    }
    appearance->confusable.push_back(
        {static_cast<NodeIdx>(node1), static_cast<NodeIdx>(node2), OfThousandths(score)});
  }
  return Ok();
}

// The nodes' rows; links go to `links`.
Status ReadNodes(SQLite::Database& database, const std::string& path, int64_t num_nodes,
                 Appearance* appearance, std::vector<AppearanceLink>* links) {
  LimitedStatement rows(
      database,
      "SELECT node_idx, component_idx, role, images, neighbours, num_inliers, entropy FROM nodes ORDER "
      "BY node_idx");
  for (NodeIdx i = 0; rows.executeStep(); ++i) {
    const std::string what = fmt::format("{}: table nodes, node {}", path, i);
    if (rows.getColumn(0).getInt64() != i || i >= num_nodes) {
      return MakeError(ErrorCode::kCorrupt, "{}: missing, or more than the {} nodes that the file states",
                       what, num_nodes);
    }
    AppearanceNode node;
    node.component = rows.getColumn(1).getInt();
    const int role = rows.getColumn(2).getInt();
    if (node.component < 0 || node.component >= appearance->NumComponents() || role < 0 || role > 2) {
      return MakeError(ErrorCode::kCorrupt, "{}: component {} and role {} are not known", what,
                       node.component, role);
    }
    node.role = static_cast<NodeRole>(role);
    CAIRN_ASSIGN_OR_RETURN(node.images, BlobToVector<ImageId>(rows.getColumn(3), what));
    CAIRN_ASSIGN_OR_RETURN(const std::vector<NodeIdx> neighbours,
                           BlobToVector<NodeIdx>(rows.getColumn(4), what));
    CAIRN_ASSIGN_OR_RETURN(const std::vector<int32_t> num_inliers,
                           BlobToVector<int32_t>(rows.getColumn(5), what));
    if (neighbours.size() != num_inliers.size()) {
      return MakeError(ErrorCode::kCorrupt, "{}: {} neighbours but {} numbers of inliers", what,
                       neighbours.size(), num_inliers.size());
    }
    for (size_t k = 0; k < neighbours.size(); ++k) {
      if (neighbours[k] <= (k == 0 ? i : neighbours[k - 1]) || neighbours[k] >= num_nodes ||
          num_inliers[k] <= 0) {
        return MakeError(ErrorCode::kCorrupt,
                         "{}: a link to node {} with {} inliers is out of order or range", what,
                         neighbours[k], num_inliers[k]);
      }
      links->push_back({i, neighbours[k], num_inliers[k]});
    }
    if (!rows.getColumn(6).isNull()) {
      const int64_t entropy = rows.getColumn(6).getInt64();
      if (entropy < 0 || entropy > Thousandths(kMaxEntropy))
        return MakeError(ErrorCode::kCorrupt, "{}: an entropy of {} thousandths", what, entropy);
      node.entropy = OfThousandths(entropy);
    }
    appearance->nodes.push_back(std::move(node));
  }
  return Ok();
}

Result<Appearance> ReadAppearanceTables(SQLite::Database& database, const std::string& path) {
  if (!HasTable(database, "appearance") ||
      database.execAndGet("PRAGMA application_id").getInt() != kAppearanceApplicationId) {
    return MakeError(ErrorCode::kCorrupt, "{}: not an appearance graph (link-appearance writes them)", path);
  }
  if (const int version = database.execAndGet("PRAGMA user_version").getInt();
      version != kAppearanceVersion) {
    return MakeError(ErrorCode::kUnsupported, "{}: appearance version {}, this program reads {}", path,
                     version, kAppearanceVersion);
  }
  LimitedStatement header(database,
                          "SELECT num_nodes, num_links, num_components, num_dominators, strong_num_inliers, "
                          "max_detour_links FROM appearance");
  if (!header.executeStep()) return MakeError(ErrorCode::kCorrupt, "{}: table appearance is empty", path);
  const int64_t num_nodes = header.getColumn(0).getInt64(), num_links = header.getColumn(1).getInt64(),
                num_components = header.getColumn(2).getInt64();
  Appearance appearance;
  appearance.num_dominators = header.getColumn(3).getInt();
  appearance.strong_num_inliers = header.getColumn(4).getInt();
  appearance.max_detour_links = header.getColumn(5).getInt();
  LimitedStatement bounds(database, "SELECT component_idx, lower_bound FROM components ORDER BY 1");
  while (bounds.executeStep()) {
    if (bounds.getColumn(0).getInt64() != appearance.NumComponents()) {
      return MakeError(ErrorCode::kCorrupt, "{}: table components, component {}: missing", path,
                       appearance.NumComponents());
    }
    appearance.lower_bounds.push_back(bounds.getColumn(1).getInt());
  }
  std::vector<AppearanceLink> links;
  CAIRN_RETURN_IF_ERROR(ReadNodes(database, path, num_nodes, &appearance, &links));
  if (static_cast<int64_t>(appearance.nodes.size()) != num_nodes ||
      static_cast<int64_t>(links.size()) != num_links || appearance.NumComponents() != num_components) {
    return MakeError(ErrorCode::kCorrupt, "{}: {} nodes, {} links, {} components; its header says {}, {}, {}",
                     path, appearance.nodes.size(), links.size(), appearance.NumComponents(), num_nodes,
                     num_links, num_components);
  }
  appearance.graph = AppearanceGraph(static_cast<int>(num_nodes), std::move(links));
  CAIRN_RETURN_IF_ERROR(ReadConfusable(database, path, &appearance));
  return appearance;
}

}  // namespace

std::vector<NodeIdx> Appearance::Kept() const {
  std::vector<NodeIdx> kept;
  for (size_t i = 0; i < nodes.size(); ++i) {
    if (nodes[i].role != NodeRole::kDropped) kept.push_back(static_cast<NodeIdx>(i));
  }
  return kept;
}

std::vector<ImageId> Appearance::KeptImages() const {
  std::vector<ImageId> images;
  for (const AppearanceNode& node : nodes) {
    if (node.role != NodeRole::kDropped) images.insert(images.end(), node.images.begin(), node.images.end());
  }
  std::sort(images.begin(), images.end());
  return images;
}

int Appearance::LowerBound() const {
  std::vector<char> is_in(lower_bounds.size(), 0);
  for (const AppearanceNode& node : nodes) is_in[node.component] |= node.role != NodeRole::kDropped;
  int sum = 0;
  for (size_t i = 0; i < lower_bounds.size(); ++i) {
    if (is_in[i] && lower_bounds[i] == 0) return 0;
    sum += lower_bounds[i];
  }
  return sum;
}

Status WriteAppearance(const Appearance& appearance, const std::string& path) {
  return WriteDatabase(path, kAppearanceSql, [&](SQLite::Database& database) -> Status {
    SQLite::Statement header(database, "INSERT INTO appearance VALUES (?, ?, ?, ?, ?, ?)");
    header.bind(1, appearance.graph.num_nodes());
    header.bind(2, appearance.graph.num_links());
    header.bind(3, appearance.NumComponents());
    header.bind(4, appearance.num_dominators);
    header.bind(5, appearance.strong_num_inliers);
    header.bind(6, appearance.max_detour_links);
    header.exec();
    WriteComponents(database, appearance);
    WriteNodes(database, appearance);
    WriteConfusable(database, appearance);
    return Ok();
  });
}

Result<Appearance> ReadAppearance(const std::string& path) {
  return WithDatabaseErrors(path, [&]() -> Result<Appearance> {
    CAIRN_ASSIGN_OR_RETURN(SQLite::Database database, OpenDatabaseReadOnly(path));
    return ReadAppearanceTables(database, path);
  });
}

}  // namespace cairn
