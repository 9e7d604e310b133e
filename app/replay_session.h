// Replays a recorded session on one thread: the same poses, map and frames, bit for bit, although it ran on two.
#pragma once

#include <memory>
#include <string>

#include "app/run_session.h"
#include "camera/recording_source.h"

namespace parallax {

struct ReplayReport {
  enum class Verdict {
    identical,   // every frame's result, and the last map
    incomplete,  // as far as the recording goes: it was cut off, or lost frames
    different,   // something came out otherwise
  };
  Verdict verdict = Verdict::identical;
  int frames_compared = 0;
  std::string text;  // one line for the user
};

// Whether the recording carries a schedule to replay: sources that are cut down by options do not.
bool can_replay(const RecordingSource& source);

// Runs it with the options it was recorded with (`options` keeps the present ones for everything else). What comes out
// otherwise than recorded is told in the report, never thrown. Throws InputError when its settings or schedule are
// unreadable.
RunResult replay_session(RecordingSource* source, const RunOptions& options, const FrameObserver& observer,
                         ReplayReport* report);

// The options that the recording was made with, as far as they decide what is computed.
RunOptions recorded_options(const RecordingSource& source, const RunOptions& others);

}  // namespace parallax
