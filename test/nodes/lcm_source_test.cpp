// The receive buffer that the driver asks of LCM.
#include "nodes/lcm_source.h"

#include <gtest/gtest.h>

#include <cstdlib>

namespace faultline {
namespace {

TEST(ReceiveBuffer, IsAskedForOnUdpUnlessGiven) {
  EXPECT_EQ(with_receive_buffer("udpm://239.255.76.67:7667?ttl=0", 4194304),
            "udpm://239.255.76.67:7667?ttl=0&recv_buf_size=4194304");
  EXPECT_EQ(with_receive_buffer("udpm://239.255.76.67:7667", 100000000),
            "udpm://239.255.76.67:7667?recv_buf_size=4194304");
  EXPECT_EQ(with_receive_buffer("udpm://239.255.76.67:7667?ttl=0", 212992),
            "udpm://239.255.76.67:7667?ttl=0&recv_buf_size=212992");
  EXPECT_EQ(with_receive_buffer("udpm://239.255.76.67:7667?recv_buf_size=5000", 212992),
            "udpm://239.255.76.67:7667?recv_buf_size=5000");
  EXPECT_EQ(with_receive_buffer("udpm://239.255.76.67:7667?ttl=0", 0), "udpm://239.255.76.67:7667?ttl=0");
}

TEST(ReceiveBuffer, LeavesOtherLinksAlone) {
  EXPECT_EQ(with_receive_buffer("memq://", 4194304), "memq://");
  EXPECT_EQ(with_receive_buffer("file:///tmp/a.lcm", 4194304), "file:///tmp/a.lcm");
}

TEST(ReceiveBuffer, OfTheDefaultUrl) {
  unsetenv("LCM_DEFAULT_URL");
  EXPECT_EQ(with_receive_buffer("", 4194304), "udpm://239.255.76.67:7667?ttl=0&recv_buf_size=4194304");
  setenv("LCM_DEFAULT_URL", "memq://", 1);
  EXPECT_EQ(with_receive_buffer("", 4194304), "memq://");
  unsetenv("LCM_DEFAULT_URL");
}

}  // namespace
}  // namespace faultline
