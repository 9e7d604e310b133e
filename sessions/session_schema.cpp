#include "sessions/session_schema.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <cmath>

namespace parallax::session_file {
namespace {

// Version 1. Rows of blobs that are large have an index of their own; the others are kept in the order of their key.
constexpr const char* kVersion1 = R"(
CREATE TABLE meta(key TEXT PRIMARY KEY NOT NULL, value TEXT NOT NULL, checksum INTEGER NOT NULL) WITHOUT ROWID;
CREATE TABLE session(id INTEGER PRIMARY KEY, name TEXT NOT NULL, source TEXT NOT NULL, camera BLOB NOT NULL,
  rectified_from_left BLOB NOT NULL, frames_per_second REAL NOT NULL, ended INTEGER NOT NULL,
  component INTEGER NOT NULL, global_from_session BLOB NOT NULL, anchor_covariance BLOB NOT NULL, began TEXT NOT NULL,
  checksum INTEGER NOT NULL);
CREATE TABLE keyframe(session INTEGER NOT NULL, keyframe INTEGER NOT NULL, frame INTEGER NOT NULL,
  time_ns INTEGER NOT NULL, after_failure INTEGER NOT NULL, images INTEGER NOT NULL, checksum INTEGER NOT NULL,
  PRIMARY KEY(session, keyframe)) WITHOUT ROWID;
CREATE TABLE pose(session INTEGER NOT NULL, keyframe INTEGER NOT NULL, session_from_camera BLOB NOT NULL,
  checksum INTEGER NOT NULL, PRIMARY KEY(session, keyframe)) WITHOUT ROWID;
CREATE TABLE feature(session INTEGER NOT NULL, keyframe INTEGER NOT NULL, features BLOB NOT NULL,
  checksum INTEGER NOT NULL, PRIMARY KEY(session, keyframe));
CREATE TABLE image(session INTEGER NOT NULL, keyframe INTEGER NOT NULL, width INTEGER NOT NULL,
  height INTEGER NOT NULL, left_grey BLOB NOT NULL, right_grey BLOB NOT NULL, checksum INTEGER NOT NULL,
  PRIMARY KEY(session, keyframe));
CREATE TABLE edge(session INTEGER NOT NULL, first INTEGER NOT NULL, second INTEGER NOT NULL,
  first_from_second BLOB NOT NULL, covariance BLOB NOT NULL, after_failure INTEGER NOT NULL, checksum INTEGER NOT NULL,
  PRIMARY KEY(session, first, second)) WITHOUT ROWID;
CREATE TABLE point(session INTEGER NOT NULL, first INTEGER NOT NULL, last INTEGER NOT NULL, points BLOB NOT NULL,
  checksum INTEGER NOT NULL, PRIMARY KEY(session, first, last));
CREATE TABLE encounter(id INTEGER PRIMARY KEY, found_session INTEGER NOT NULL, found_keyframe INTEGER NOT NULL,
  query_session INTEGER NOT NULL, query_keyframe INTEGER NOT NULL, found_from_query BLOB NOT NULL,
  covariance BLOB NOT NULL, scores BLOB NOT NULL, matches INTEGER NOT NULL, inliers INTEGER NOT NULL,
  state TEXT NOT NULL, checksum INTEGER NOT NULL);
CREATE TABLE timing(session INTEGER NOT NULL, keyframe INTEGER NOT NULL, module INTEGER NOT NULL,
  closed INTEGER NOT NULL, ms REAL NOT NULL, checksum INTEGER NOT NULL,
  PRIMARY KEY(session, keyframe, module, closed)) WITHOUT ROWID;
CREATE TABLE attached_map(id INTEGER PRIMARY KEY, name TEXT NOT NULL, path TEXT NOT NULL, session INTEGER NOT NULL,
  keyframe INTEGER NOT NULL, keyframe_from_map BLOB NOT NULL, agreements INTEGER NOT NULL, checksum INTEGER NOT NULL);
)";
constexpr const char* kMigrations[] = {kVersion1};

constexpr double kRotationTolerance = 1e-6;
constexpr double kSymmetryTolerance = 1e-6;  // of an element, in parts of the deviations it relates
constexpr int kMostSide = 1 << 14;           // pixels: no camera is wider
constexpr std::size_t kFeatureBytes = 45, kPointBytes = 20;

constexpr const char* kStates[] = {"waiting", "active", "refused", "off"};

bool is_rotation(const Eigen::Matrix3d& R) {
  return R.allFinite() &&
         (R.transpose() * R - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() <= kRotationTolerance &&
         R.determinant() > 0;
}

}  // namespace

std::span<const char* const> migrations() { return kMigrations; }

const char* name_of(EncounterState state) { return kStates[static_cast<std::size_t>(state)]; }

bool state_of(std::string_view name, EncounterState* state) {
  for (std::size_t i = 0; i < std::size(kStates); ++i)
    if (name == kStates[i]) {
      *state = static_cast<EncounterState>(i);
      return true;
    }
  return false;
}

bool is_sound(const RigidTransform& transform) { return is_rotation(transform.R) && transform.t.allFinite(); }

bool is_sound(const SimilarityTransform& transform) {
  return std::isfinite(transform.s) && transform.s > 0 && is_rotation(transform.R) && transform.t.allFinite();
}

bool is_sound(const StereoCamera& camera) {
  return camera.width >= 8 && camera.height >= 8 && camera.width <= kMostSide && camera.height <= kMostSide &&
         camera.focal_px.allFinite() && camera.focal_px.minCoeff() > 0 && camera.centre_px.allFinite() &&
         std::isfinite(camera.baseline_m) && camera.baseline_m > 0;
}

bool is_sound(const SessionFeatures& features) {
  if (features.right_px.size() != features.features.size()) return false;
  for (const PlaceFeature& f : features.features)
    if (!f.pixel.allFinite() || f.level < 0 || f.level >= kPyramidLevels) return false;
  for (const float right : features.right_px)
    if (std::isinf(right)) return false;
  return true;
}

bool is_sound(const std::vector<SessionPoint>& points) {
  for (const SessionPoint& p : points)
    if (p.keyframe < 0 || !p.camera.allFinite() || p.poses < 0) return false;
  return true;
}

bool is_covariance(const Matrix6d& matrix, bool definite) {
  if (!matrix.allFinite()) return false;
  for (int i = 0; i < 6; ++i)
    for (int j = 0; j < i; ++j)
      if (std::abs(matrix(i, j) - matrix(j, i)) > kSymmetryTolerance * std::sqrt(std::abs(matrix(i, i) * matrix(j, j))))
        return false;
  if (definite) return Eigen::LLT<Matrix6d>(matrix).info() == Eigen::Success;
  const Eigen::SelfAdjointEigenSolver<Matrix6d> eigen(matrix, Eigen::EigenvaluesOnly);
  return eigen.info() == Eigen::Success && eigen.eigenvalues()[0] >= -1e-9 * std::abs(eigen.eigenvalues()[5]);
}

bool are_scores(const Encounter& e) {
  return std::isfinite(e.bow) && !std::isinf(e.crf_near) && !std::isinf(e.crf_far);
}

std::vector<std::byte> pack(const Matrix6d& matrix) {
  std::vector<std::byte> out;
  append_rows(matrix, &out);
  return out;
}

std::vector<std::byte> pack(const StereoCamera& camera) {
  std::vector<std::byte> out;
  append<std::int32_t>(camera.width, &out);
  append<std::int32_t>(camera.height, &out);
  append_rows(camera.focal_px, &out);
  append_rows(camera.centre_px, &out);
  append(camera.baseline_m, &out);
  return out;
}

std::vector<std::byte> pack(const SessionFeatures& features) {
  std::vector<std::byte> out;
  out.reserve(kFeatureBytes * features.features.size());
  for (std::size_t i = 0; i < features.features.size(); ++i) {
    const PlaceFeature& f = features.features[i];
    append(f.pixel.x(), &out);
    append(f.pixel.y(), &out);
    append(features.right_px[i], &out);
    append(static_cast<std::uint8_t>(f.level), &out);
    for (const std::uint64_t bits : f.descriptor.bits) append(bits, &out);
  }
  return out;
}

std::vector<std::byte> pack(const std::vector<SessionPoint>& points) {
  std::vector<std::byte> out;
  out.reserve(kPointBytes * points.size());
  for (const SessionPoint& p : points) {
    append<std::int32_t>(p.keyframe, &out);
    for (int i = 0; i < 3; ++i) append(p.camera[i], &out);
    append<std::int32_t>(p.poses, &out);
  }
  return out;
}

std::vector<std::byte> pack_scores(const Encounter& encounter) {
  std::vector<std::byte> out;
  for (const double score : {encounter.bow, encounter.crf_near, encounter.crf_far}) append(score, &out);
  return out;
}

bool unpack(std::span<const std::byte> bytes, RigidTransform* transform) {
  ByteReader reader(bytes);
  return reader.take_rows(&transform->R) && reader.take_rows(&transform->t) && reader.at_end() && is_sound(*transform);
}

bool unpack(std::span<const std::byte> bytes, SimilarityTransform* transform) {
  ByteReader reader(bytes);
  return reader.take(&transform->s) && reader.take_rows(&transform->R) && reader.take_rows(&transform->t) &&
         reader.at_end() && is_sound(*transform);
}

bool unpack(std::span<const std::byte> bytes, Matrix6d* matrix) {
  ByteReader reader(bytes);
  return reader.take_rows(matrix) && reader.at_end() && matrix->allFinite();
}

bool unpack(std::span<const std::byte> bytes, StereoCamera* camera) {
  ByteReader reader(bytes);
  std::int32_t width = 0, height = 0;
  if (!reader.take(&width) || !reader.take(&height) || !reader.take_rows(&camera->focal_px) ||
      !reader.take_rows(&camera->centre_px) || !reader.take(&camera->baseline_m) || !reader.at_end())
    return false;
  camera->width = width;
  camera->height = height;
  return is_sound(*camera);
}

bool unpack(std::span<const std::byte> bytes, SessionFeatures* features) {
  if (bytes.size() % kFeatureBytes != 0) return false;
  ByteReader reader(bytes);
  features->features.resize(bytes.size() / kFeatureBytes);
  features->right_px.resize(features->features.size());
  for (std::size_t i = 0; i < features->features.size(); ++i) {
    PlaceFeature& f = features->features[i];
    std::uint8_t level = 0;
    if (!reader.take(&f.pixel.x()) || !reader.take(&f.pixel.y()) || !reader.take(&features->right_px[i]) ||
        !reader.take(&level))
      return false;
    f.level = level;
    for (std::uint64_t& bits : f.descriptor.bits)
      if (!reader.take(&bits)) return false;
  }
  return is_sound(*features);
}

bool unpack(std::span<const std::byte> bytes, std::vector<SessionPoint>* points) {
  if (bytes.size() % kPointBytes != 0) return false;
  ByteReader reader(bytes);
  points->resize(bytes.size() / kPointBytes);
  for (SessionPoint& p : *points) {
    std::int32_t keyframe = 0, poses = 0;
    if (!reader.take(&keyframe)) return false;
    for (int i = 0; i < 3; ++i)
      if (!reader.take(&p.camera[i])) return false;
    if (!reader.take(&poses)) return false;
    p.keyframe = keyframe;
    p.poses = poses;
  }
  return is_sound(*points);
}

bool unpack_scores(std::span<const std::byte> bytes, Encounter* encounter) {
  ByteReader reader(bytes);
  return reader.take(&encounter->bow) && reader.take(&encounter->crf_near) && reader.take(&encounter->crf_far) &&
         reader.at_end() && are_scores(*encounter);
}

}  // namespace parallax::session_file
