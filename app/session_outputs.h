// What several sessions leave behind together. Files are written beside and renamed; RunError when one cannot be.
// Plain functions, safe from any thread.
#pragma once

#include <string>

#include "app/slam_sessions.h"

namespace parallax {

// All sessions of the run in the global frame, for `parallax eval`: session k (0, 1...) is k million seconds later than
// its own time stamps, so that none coincide.
void write_joint_trajectory(const SlamSessionsResult& run, const std::string& path);
void write_joint_truth(const SlamSessionsResult& run, const std::string& path);

// A row an encounter, with its provenance, and one a candidate that place recognition refused; with the error of the
// motion where the sources of this run carry true poses.
void write_encounters_csv(const SlamSessionsResult& run, const std::string& path);

// Loops and meetings in a few lines; nothing to tell: empty.
std::string meetings_text(const SlamSessionsResult& run);

const char* to_string(EncounterState state);

}  // namespace parallax
