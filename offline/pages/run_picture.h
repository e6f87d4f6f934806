#pragma once

#include "runtime/record/picture_source.h"

namespace tumbler {

/// Makes pictures of robots from the robot files and the tasks in motions: all collision and visual
/// shapes but meshes, and the ground. Half-spaces are cut off 20 m from the middle.
PictureSource MakePictureSource();

}  // namespace tumbler
