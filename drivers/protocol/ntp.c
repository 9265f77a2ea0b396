/* SPDX-License-Identifier: MIT */
#include "drivers/protocol/ntp.h"

#include <string.h>

#include "core/bytes.h"

enum { STRATUM = 1, ROOT_DELAY = 4, ROOT_DISPERSION = 8, REFERENCE = 12, ORIGINATE = 24, RECEIVE = 32, TRANSMIT = 40 };
enum { VERSION = 4, CLIENT = 3, SERVER = 4, ALARM = 3, LEAP_SHIFT = 6, VERSION_SHIFT = 3, MOST_STRATUM = 15 };

#define SECOND_NS    INT64_C(1000000000)
#define SECONDS_1900 INT64_C(2208988800) /* from 1900 to 1970 */

static void put_time(uint8_t *p, int64_t ns)
{
    const int64_t rest_ns = (ns % SECOND_NS + SECOND_NS) % SECOND_NS;
    be_put32(p, (uint32_t)((ns - rest_ns) / SECOND_NS + SECONDS_1900));
    be_put32(p + 4, (uint32_t)(((uint64_t)rest_ns << 32) / (uint64_t)SECOND_NS));
}

static int64_t get_time(const uint8_t *p)
{
    const int64_t s = be_get32(p), era_s = (s & INT64_C(0x80000000)) != 0 ? 0 : INT64_C(0x100000000);
    const uint64_t fraction = be_get32(p + 4);
    return (s + era_s - SECONDS_1900) * SECOND_NS + (int64_t)((fraction * (uint64_t)SECOND_NS + 0x80000000) >> 32);
}

void ntp_write_request(uint8_t packet[NTP_LEN], int64_t t1_ns)
{
    memset(packet, 0, NTP_LEN);
    packet[0] = VERSION << VERSION_SHIFT | CLIENT;
    put_time(packet + TRANSMIT, t1_ns);
}

/* RFC 4330, section 5, suggests this check: the root delay and the root dispersion are each below a second. */
static int is_synchronised(const uint8_t *packet)
{
    static const uint8_t none[8] = {0};
    return packet[0] >> LEAP_SHIFT != ALARM && packet[STRATUM] <= MOST_STRATUM &&
           be_get32(packet + ROOT_DELAY) >> 16 == 0 && be_get32(packet + ROOT_DISPERSION) >> 16 == 0 &&
           memcmp(packet + TRANSMIT, none, sizeof none) != 0;
}

enum ntp_kind ntp_read_answer(const uint8_t *packet, size_t len, int64_t t1_ns, int64_t t4_ns, struct ntp_answer *out)
{
    uint8_t sent[NTP_LEN];
    *out = (struct ntp_answer){.kiss = ""};
    if (len < NTP_LEN) return NTP_FOREIGN;
    const unsigned version = packet[0] >> VERSION_SHIFT & 7u;
    ntp_write_request(sent, t1_ns);
    if ((packet[0] & 7u) != SERVER || version == 0 || version > VERSION ||
        memcmp(packet + ORIGINATE, sent + TRANSMIT, 8) != 0)
        return NTP_FOREIGN;
    if (packet[STRATUM] == 0) {
        for (int i = 0; i < 4; i++)
            out->kiss[i] =
                (char)(packet[REFERENCE + i] > ' ' && packet[REFERENCE + i] <= '~' ? packet[REFERENCE + i] : '?');
        return NTP_KISS;
    }
    const int64_t t2_ns = get_time(packet + RECEIVE), t3_ns = get_time(packet + TRANSMIT);
    out->delay_ns = (t4_ns - t1_ns) - (t3_ns - t2_ns);
    const int64_t there_ns = t2_ns - t1_ns, back_ns = t3_ns - t4_ns;
    out->offset_ns = there_ns / 2 + back_ns / 2 + (there_ns % 2 + back_ns % 2) / 2; /* their sum may have no room */
    return is_synchronised(packet) && t3_ns >= t2_ns && out->delay_ns >= 0 ? NTP_GOOD : NTP_UNSYNCHRONISED;
}

void ntp_change_answer(uint8_t packet[NTP_LEN], enum ntp_change change, int64_t step_ns)
{
    if (change == NTP_UNSYNCHRONISE) packet[0] = (uint8_t)(packet[0] | ALARM << LEAP_SHIFT);
    if (change == NTP_DENY) packet[STRATUM] = 0;
    if (change == NTP_DENY) memcpy(packet + REFERENCE, "DENY", 4);
    if (change != NTP_STEP) return;
    put_time(packet + RECEIVE, get_time(packet + RECEIVE) + step_ns);
    put_time(packet + TRANSMIT, get_time(packet + TRANSMIT) + step_ns);
}
