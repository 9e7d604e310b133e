#include "tracker/source_trust.h"

#include <cstddef>

#include "core/log.h"

namespace parallax {
namespace {

// What a frame's counts are worth one frame later.
constexpr double kMemory = 0.9;
// Fewer searches say nothing of a keyframe.
constexpr double kEvidence = 40;
// With fewer than so many, nothing is known of it at all.
constexpr double kKnown = 1;
// The same where only some are probed.
constexpr double kProbedEvidence = 4;
// Keyframes made meanwhile that make a return of one that comes into view.
constexpr std::size_t kAbsence = 20;
// The part of the points found of those in place has to be above this, with so many inliers, for others to be judged.
constexpr double kReferencePart = 0.4;
constexpr int kReferenceInliers = 60;
// Of that part: below, a keyframe is out of place; above, it is in place again.
constexpr double kLeaves = 0.35, kReturns = 0.6;

}  // namespace

SourceTrust::Source& SourceTrust::source(KeyframeId id) {
  const auto index = static_cast<std::size_t>(id.index);
  if (index >= sources_.size()) sources_.resize(index + 1);
  if (sources_[index].id != id) sources_[index] = Source{.id = id};
  return sources_[index];
}

void SourceTrust::update(const TwoStageResult& result, const TrackingSnapshot& map) {
  for (Source& s : sources_) {
    s.searched *= kMemory;
    s.agreed *= kMemory;
  }
  ++frame_;
  const std::size_t keyframes = map.keyframes.size();
  const auto count = [&](std::int32_t row, bool agrees) {
    Source& s = source(map.keyframes[static_cast<std::size_t>(map.source[static_cast<std::size_t>(row)])].id);
    // What was looked for in the frame before has not been away, however many keyframes came at once (maps that merge).
    if (s.last_seen > 0 && s.frame + 1 < frame_ && keyframes >= s.last_seen + kAbsence) {
      s.state = State::arriving;
      s.searched = s.agreed = 0;
    }
    s.last_seen = keyframes;
    s.frame = frame_;
    s.searched += 1;
    if (agrees) s.agreed += 1;
  };
  for (const Candidate& c : result.missed) count(c.row, false);
  for (const MatchedPoint& m : result.matches) count(m.row, m.weight > 0);
  for (const ProbedPoint& p : result.probed) count(p.row, p.agrees);

  double searched = 0, agreed = 0;
  for (const Source& s : sources_) {
    if (s.state != State::in_place) continue;
    searched += s.searched;
    agreed += s.agreed;
  }
  if (result.inliers < kReferenceInliers || !(agreed > kReferencePart * searched)) return;
  const double reference = agreed / searched;
  for (Source& s : sources_) {
    const double part = s.searched > 0 ? s.agreed / s.searched : 0;
    if (s.state == State::arriving && s.searched >= kEvidence)
      s.state = part < kLeaves * reference ? State::out_of_place : State::in_place;
    else if (s.state == State::out_of_place && s.searched >= kProbedEvidence && part > kReturns * reference)
      s.state = State::in_place;
    else
      continue;
    log::debug("points of keyframe ", s.id.index,
               s.state == State::in_place ? " are in place: " : " are out of place: ", s.agreed, " of ", s.searched,
               " found, of others ", agreed, " of ", searched);
  }
}

const std::vector<std::uint8_t>& SourceTrust::out_of_place(const TrackingSnapshot& map) {
  const std::size_t n = map.keyframes.size();
  constexpr std::size_t kNever = static_cast<std::size_t>(-1);
  rows_.assign(n, 0);
  std::size_t before = kNever;
  for (std::size_t row = 0; row < n; ++row) {
    const Source& s = source(map.keyframes[row].id);
    if (s.searched < kKnown) continue;
    rows_[row] = s.state == State::out_of_place ? 1 : 0;
    const std::size_t first = before == kNever ? 0 : before + 1;
    for (std::size_t k = first; k < row; ++k) rows_[k] = rows_[before == kNever || row - k < k - before ? row : before];
    before = row;
  }
  if (before != kNever)
    for (std::size_t k = before + 1; k < n; ++k) rows_[k] = rows_[before];
  return rows_;
}

}  // namespace parallax
