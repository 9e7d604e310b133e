// Makes the weights of CRF-Matching (place/crf_model.h) from stereo recordings whose poses are known: pairs of scenes
// of one place and pairs of scenes that are alike and are not.
#pragma once

#include <memory>
#include <ostream>
#include <string>
#include <vector>

#include "place/crf_model.h"
#include "place/crf_training.h"
#include "place/vocabulary.h"

namespace parallax {

struct MatchingTrainingOptions {
  double every_s = 1;          // between scenes; the one before is the scene a second ago of MS Eq. 4 and 5
  double max_distance_m = 3;   // between the cameras of two scenes of one place...
  double max_angle_deg = 40;   // ... and between their directions
  double min_gap_s = 15;       // between scenes of one place in one recording
  double min_different_m = 8;  // between the cameras of two scenes of different places in one world...
  int max_shared = 2;          // ... and of the near features the most that both show
  double beta = 2;             // of MS Eq. 5
  double refusal_weight = 4;   // a place refused to another accepted (choose_explained)
  StereoSceneOptions scene;
  CrfTrainingOptions training;

  void validate() const;  // throws InputError naming the field
};

// A source is one recording with truth, or several of one world, joined by '+'. Recordings of different sources never
// show one place. What is counted goes to `report`, a few lines. Throws InputError for a source without truth, and when
// there are no pairs of either kind.
CrfModel train_matching(const std::vector<std::string>& sources, const std::shared_ptr<const Vocabulary>& vocabulary,
                        const MatchingTrainingOptions& options, std::ostream& report);

}  // namespace parallax
