// Parts of a saved map for other programs. All throw RunError when something cannot be written.
#pragma once

#include <string>

#include "map/map_document.h"

namespace parallax {

// Level-0 images as FOLDER/keyframe_00012.png; the folder is made when it is not there.
void write_keyframe_images(const Map& map, const std::string& folder);

// cameras.txt, images.txt and points3D.txt as COLMAP reads them: its pixels have their origin at the corner of the
// image, ours at the centre of the first pixel. Image names are those of write_keyframe_images. `name`: of the map
// file, for errors (InputError) of its calibration.
void write_colmap_model(const MapDocument& document, const std::string& name, const std::string& folder);

}  // namespace parallax
