// SPDX-License-Identifier: Apache-2.0
#include "helicarm/operating_room/virtual_room.h"

#include <gtest/gtest.h>
