#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# on_swiftshader.sh FOLDER PROGRAM [ARGUMENT]...: runs a program on the driver and under the validation layer that
# scripts/fetch_swiftshader.sh put into FOLDER.
folder=$1
shift
if [ ! -e "$folder/driver.json" ]; then
  echo "this case is skipped: no SwiftShader (scripts/fetch_swiftshader.sh $folder)"
  exit 0
fi
export VK_DRIVER_FILES="$folder/driver.json" VK_ICD_FILENAMES="$folder/driver.json" VK_LAYER_PATH="$folder"
exec "$@"
