// SPDX-License-Identifier: Apache-2.0
// The whole library.
#pragma once
#include "textured_gaussians/camera.h"
#include "textured_gaussians/convert.h"
#include "textured_gaussians/dataset.h"
#include "textured_gaussians/error.h"
#include "textured_gaussians/evaluate.h"
#include "textured_gaussians/image.h"
#include "textured_gaussians/model.h"
#include "textured_gaussians/render.h"
#include "textured_gaussians/train.h"
#include "textured_gaussians/version.h"
