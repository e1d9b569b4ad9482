#include "server/encode.h"

#include <gtest/gtest.h>

namespace adhesim {
namespace {

// A message that is used again, from whatever was in it before, as streams do.
TEST(EncodeFrame, CarriesOnlyWhatAViewerAskedFor) {
  SessionFrame frame;
  frame.frame.position_m.assign(6, 1);
  frame.frame.strain_energy_j.assign(2, 1);
  frame.frame.contacts.resize(3);
  v1::Frame message;
  for (const bool strain_energy : {true, false}) {
    for (const bool contacts : {true, false, true}) {
      EncodeFrame(frame, {v1::POSITION_ENCODING_FLOAT32, strain_energy, contacts}, &message);
      EXPECT_EQ(message.positions().size(), 6 * sizeof(float));
      EXPECT_EQ(message.strain_energy().size(), strain_energy ? 2 * sizeof(float) : 0);
      EXPECT_EQ(message.contacts_size(), contacts ? 3 : 0);
    }
  }
}

}  // namespace
}  // namespace adhesim
