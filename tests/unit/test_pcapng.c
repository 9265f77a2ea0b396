/* SPDX-License-Identifier: MIT */
/* pcapng, block by block: every frame is a packet with its bytes and its device time. Files are read back whole, cut
 * and damaged. */
#include "core/bytes.h"
#include "core/rng.h"
#include "drivers/protocol/pcap.h"
#include "drivers/protocol/pcapng.h"
#include "tests/unit/recorder_rig.h"

static void put_event(int64_t t_ns, const char *text)
{
    uint8_t out[256];
    struct native_event e = {.code = NATIVE_EV_STATE};
    snprintf(e.text, sizeof e.text, "%s", text);
    rig_put(out, native_encode_event(out, sizeof out, &e, t_ns, 0));
}

static void test_packets(void **state)
{
    (void)state;
    static const int64_t t_ns[3] = {0, 0x123456789abcd, 5};
    struct sh_err err = {0};
    const char *path = rig_path("a.pcapng");
    size_t len, stream_len;
    rig_begin();
    for (int i = 0; i < 3; i++)
        put_event(t_ns[i], "state");
    assert_int_equal(rig_record(path, (struct recorder_options){0}, RIG_KEEP, &err), 0);
    uint8_t *file = rig_read(path, &len), *stream = rig_read(rig_shs, &stream_len), *at = file, *frame = stream;
    unlink(path);
    for (int block = 0; at < file + len; block++) {
        uint32_t block_len = (uint32_t)rig_uint(at + 4, 4);
        assert_int_equal(block_len % 4, 0);
        assert_int_equal(rig_uint(at + block_len - 4, 4), block_len);
        assert_int_equal(rig_uint(at, 4), block == 0 ? 0x0a0d0d0a : block == 1 ? 1 : 6);
        if (block == 0) assert_int_equal(rig_uint(at + 8, 4), 0x1a2b3c4d);
        if (block == 1) assert_int_equal(rig_uint(at + 8, 2), 147);
        if (block >= 2) {
            uint32_t n = (uint32_t)rig_uint(at + 20, 4);
            assert_int_equal(rig_uint(at + 12, 4) << 32 | rig_uint(at + 16, 4), t_ns[block - 2]);
            assert_int_equal(rig_uint(at + 24, 4), n);
            assert_true(frame + n <= stream + stream_len);
            assert_memory_equal(at + 28, frame, n);
            frame += n;
        }
        at += block_len;
    }
    assert_ptr_equal(at, file + len);
    assert_ptr_equal(frame, stream + stream_len);
    free(file);
    free(stream);
}

static void test_disk_full(void **state)
{
    (void)state;
    rig_begin();
    for (int i = 0; i < 100; i++)
        put_event(i, "state");
    rig_check_disk_full(rig_path("full.pcapng"), 3000);
}

/* Writes a file of two interfaces and 40 packets of 0 to 39 bytes; packet i has the time i * 1,000,000,007 ns. */
static size_t put_file(uint8_t *to)
{
    uint8_t data[40];
    size_t len = pcapng_put_section(to, "test");
    len += pcapng_put_interface(to + len, PCAPNG_ETHERNET, 100, "first", NULL);
    len += pcapng_put_interface(to + len, PCAPNG_USER0, 100, NULL, "second");
    for (uint32_t i = 0; i < 40; i++) {
        memset(data, (int)i, sizeof data);
        len += pcapng_put_packet(to + len, i % 2, i * INT64_C(1000000007), data, i, 0);
    }
    return len;
}

/* Gives the bytes from `at` on to the reader, `piece` more at a time. Returns how many packets there were; *end: the
 * place of the first bytes that are no whole block. */
static uint32_t read_packets(const uint8_t *bytes, size_t len, size_t piece, size_t *end, int *rc)
{
    struct pcapng_reader reader = {0};
    struct pcapng_packet packet;
    struct sh_err err = {0};
    uint32_t n = 0;
    size_t have = 0, used;
    for (*end = 0; (*rc = pcapng_read(&reader, bytes + *end, have - *end, &packet, &used, &err)) >= 0;) {
        if (*rc == PCAPNG_MORE) {
            assert_true(used == 0 && reader.needed > have - *end);
            if (have == len) break;
            have = len - have < piece ? len : have + piece;
        }
        if (*rc == PCAPNG_PACKET) {
            assert_int_equal(packet.link, n % 2 == 0 ? PCAPNG_ETHERNET : PCAPNG_USER0);
            assert_true(packet.has_time && packet.t_ns == n * INT64_C(1000000007));
            assert_true(packet.len == n && packet.original_len == n);
            for (uint32_t i = 0; i < n; i++)
                assert_int_equal(packet.data[i], n);
            n++;
        }
        *end += used;
        assert_int_equal(reader.at_byte, *end);
    }
    return n;
}

static void test_read(void **state)
{
    (void)state;
    static uint8_t file[8192];
    const size_t len = put_file(file);
    size_t end;
    int rc;
    for (size_t piece = 1; piece < 200; piece += 7) {
        assert_int_equal(read_packets(file, len, piece, &end, &rc), 40);
        assert_true(end == len && rc == PCAPNG_MORE);
    }
    for (size_t cut = 0; cut < len; cut++) {
        assert_true(read_packets(file, cut, len, &end, &rc) < 40);
        assert_true(rc == PCAPNG_MORE && end <= cut);
    }
}

/* For any bytes, packets lie within them. */
static void test_damaged(void **state)
{
    (void)state;
    static uint8_t file[8192], hurt[8192];
    const size_t len = put_file(file);
    for (uint64_t i = 0; i < 20000; i++) {
        struct pcapng_reader reader = {0};
        struct pcapng_packet packet = {0};
        struct sh_err err = {0};
        size_t at = 0, used;
        int item;
        memcpy(hurt, file, len);
        for (uint64_t k = 0; k < 1 + i % 3; k++) {
            const uint64_t r = rng_u64(7 + k, i);
            hurt[r % (i % 2 == 0 ? 128 : len)] = (uint8_t)(r >> 32);
        }
        while ((item = pcapng_read(&reader, hurt + at, len - at, &packet, &used, &err)) > 0) {
            if (item == PCAPNG_PACKET)
                assert_true(packet.data >= hurt + at && packet.data + packet.len <= hurt + at + used);
            at += used;
        }
    }
}

/* Reads blocks until one fails. Returns why; NULL: none did. */
static const char *why_not(const uint8_t *file, size_t len)
{
    static struct sh_err err;
    struct pcapng_reader reader = {0};
    struct pcapng_packet packet;
    size_t used;
    int rc;
    for (size_t at = 0; (rc = pcapng_read(&reader, file + at, len - at, &packet, &used, &err)) > 0; at += used)
        continue;
    return rc < 0 ? err.text : NULL;
}

/* The blocks of a good file with one number changed. Numbers at a limit are good. */
static void test_limits(void **state)
{
    (void)state;
    enum { SECTION, INTERFACE, PACKET };
    static const struct {
        int block, at;
        uint32_t value;
        const char *why; /* NULL: none */
    } cases[] = {
        {SECTION, 0, 7, "not a pcapng file: it does not begin with a section"},
        {SECTION, 8, 0x4d3c2b1a, "its numbers are big-endian"},
        {SECTION, 8, 0x1a2b3c4e, "its byte-order mark is wrong"},
        {SECTION, 12, 2, "its version of pcapng is not 1"},
        {SECTION, 12, 0x10001, NULL}, /* version 1.1 */
        {SECTION, 4, 8, "at byte 0: a block of 8 bytes; allowed are multiples of 4 from 12 to 16777216"},
        {SECTION, 4, 16777216, NULL}, /* more bytes are to come */
        {SECTION, 4, 16777220, "at byte 0: a block of 16777220 bytes; "},
        {INTERFACE, 4, 11, "at byte 32: a block of 11 bytes; "},
        {SECTION, 4, 30, "a block of 30 bytes"},
        {SECTION, 4, 12, "the two lengths of a block differ"},
        {PACKET, 8, 1, "a packet of an interface that is not described"},
        {PACKET, 20, 8, NULL}, /* with what fills it up */
        {PACKET, 20, 9, "a packet is longer than its block"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        uint8_t file[512];
        size_t at[3];
        at[SECTION] = 0;
        at[INTERFACE] = pcapng_put_section(file, NULL);
        at[PACKET] = at[INTERFACE] + pcapng_put_interface(file + at[INTERFACE], PCAPNG_USER0, 0, NULL, NULL);
        const size_t len = at[PACKET] + pcapng_put_packet(file + at[PACKET], 0, 1, "abcde", 5, 0);
        assert_null(why_not(file, len));
        le_put32(file + at[cases[i].block] + cases[i].at, cases[i].value);
        const char *why = why_not(file, len);
        if ((why == NULL) != (cases[i].why == NULL) || (why != NULL && strstr(why, cases[i].why) == NULL))
            fail_msg("case %zu: %s", i, why != NULL ? why : "none");
    }
    static uint8_t many[66 * 64];
    size_t len = pcapng_put_section(many, NULL);
    for (int i = 0; i < 64; i++)
        len += pcapng_put_interface(many + len, PCAPNG_USER0, 0, NULL, NULL);
    assert_null(why_not(many, len));
    len += pcapng_put_interface(many + len, PCAPNG_USER0, 0, NULL, NULL);
    assert_non_null(strstr(why_not(many, len), "more than 64 interfaces"));
    /* Another section numbers its interfaces from 0 again. */
    len = pcapng_put_section(many, NULL);
    len += pcapng_put_interface(many + len, PCAPNG_USER0, 0, NULL, NULL);
    len += pcapng_put_section(many + len, NULL);
    const size_t second = len;
    len += pcapng_put_packet(many + len, 0, 1, "abcde", 5, 0);
    assert_non_null(strstr(why_not(many, len), "a packet of an interface that is not described"));
    len = second + pcapng_put_interface(many + second, PCAPNG_ETHERNET, 0, NULL, NULL);
    len += pcapng_put_packet(many + len, 0, 1, "abcde", 5, 0);
    struct pcapng_reader reader = {0};
    struct pcapng_packet packet;
    struct sh_err err;
    size_t used, n_packets = 0;
    for (size_t at = 0; at < len; at += used)
        n_packets += pcapng_read(&reader, many + at, len - at, &packet, &used, &err) == PCAPNG_PACKET;
    assert_int_equal(n_packets, 1);
    assert_int_equal(packet.link, PCAPNG_ETHERNET);
}

/* Blocks and options by the numbers of draft-ietf-opsawg-pcapng: if_name 2, if_tsresol 9, opt_comment 1, and
 * shb_userappl 4. */
static void test_bytes(void **state)
{
    (void)state;
    static const uint8_t section[] = {0x0a, 0x0d, 0x0d, 0x0a, 40,   0,    0,    0,    0x4d, 0x3c, 0x2b, 0x1a, 1, 0,
                                      0,    0,    0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 4,    0,    3, 0,
                                      'a',  'p',  'p',  0,    0,    0,    0,    0,    40,   0,    0,    0};
    static const uint8_t interface[] = {1,   0,   0,   0,   52,  0,   0, 0, 147, 0, 0, 0, 0,  1, 0, 0, 2, 0,
                                        4,   0,   'n', 'a', 'm', 'e', 9, 0, 1,   0, 9, 0, 0,  0, 1, 0, 5, 0,
                                        'w', 'o', 'r', 'd', 's', 0,   0, 0, 0,   0, 0, 0, 52, 0, 0, 0};
    uint8_t got[128];
    assert_int_equal(pcapng_put_section(got, "app"), sizeof section);
    assert_memory_equal(got, section, sizeof section);
    assert_int_equal(pcapng_put_interface(got, PCAPNG_USER0, 256, "name", "words"), sizeof interface);
    assert_memory_equal(got, interface, sizeof interface);
}

/* The older format, in both orders of bytes and with parts of a second in both units (libpcap's savefile.5). */
static void test_pcap(void **state)
{
    (void)state;
    enum { SECONDS = 1700000000, PART = 123456, HEAD = 24, RECORD = 16, LEN = 5 };
    for (int i = 0; i < 4; i++) {
        const int is_big = i & 1, is_ns = i >> 1;
        const uint32_t words[] = {is_ns ? 0xa1b23c4d : 0xa1b2c3d4, 0, 0, 0, 65535, 0x20093, SECONDS, PART, LEN, 60};
        uint8_t file[HEAD + RECORD + LEN] = {0};
        struct pcap_reader reader = {0};
        struct pcapng_packet packet;
        struct sh_err err = {0};
        size_t used;
        for (int k = 0; k < 10; k++)
            (is_big ? be_put32 : le_put32)(file + 4 * k, words[k]);
        file[is_big ? 5 : 4] = 2; /* the version is two numbers of 16 bits: 2.0 */
        memcpy(file + HEAD + RECORD, "abcde", LEN);
        assert_true(pcap_is(file));
        assert_int_equal(pcap_read(&reader, file, HEAD - 1, &packet, &used, &err), PCAPNG_MORE);
        assert_int_equal(pcap_read(&reader, file, HEAD, &packet, &used, &err), PCAPNG_OTHER);
        assert_int_equal(used, HEAD);
        for (size_t n = 0; n < RECORD + LEN; n++)
            assert_int_equal(pcap_read(&reader, file + HEAD, n, &packet, &used, &err), PCAPNG_MORE);
        assert_int_equal(pcap_read(&reader, file + HEAD, RECORD + LEN, &packet, &used, &err), PCAPNG_PACKET);
        assert_int_equal(used, RECORD + LEN);
        assert_int_equal(reader.at_byte, sizeof file);
        assert_int_equal(packet.link, 0x93);
        assert_true(packet.has_time && packet.t_ns == SECONDS * INT64_C(1000000000) + PART * (is_ns ? 1 : 1000));
        assert_int_equal(packet.len, LEN);
        assert_int_equal(packet.original_len, 60);
        assert_memory_equal(packet.data, "abcde", LEN);
        (is_big ? be_put32 : le_put32)(file + HEAD + 8, (uint32_t)PCAPNG_MAX_BLOCK + 1);
        assert_int_equal(pcap_read(&reader, file + HEAD, RECORD + LEN, &packet, &used, &err), SH_EFORMAT);
        assert_string_equal(err.text, "at byte 45: a packet of 16777217 bytes; allowed are 16777216 at most");
        (is_big ? be_put32 : le_put32)(file + HEAD + 8, (uint32_t)PCAPNG_MAX_BLOCK);
        assert_int_equal(pcap_read(&reader, file + HEAD, RECORD + LEN, &packet, &used, &err), PCAPNG_MORE);
        file[is_big ? 5 : 4] = 3;
        reader = (struct pcap_reader){0};
        assert_int_equal(pcap_read(&reader, file, sizeof file, &packet, &used, &err), SH_EFORMAT);
        assert_string_equal(err.text, "at byte 4: its version of pcap is 3; allowed is 2");
        file[0] ^= 1;
        assert_false(pcap_is(file));
        assert_int_equal(pcap_read(&reader, file, sizeof file, &packet, &used, &err), SH_EFORMAT);
        assert_string_equal(err.text, "at byte 0: not a pcap file: its first number is wrong");
    }
}

static void test_statistics(void **state)
{
    (void)state;
    uint8_t file[PCAPNG_FRONT_ROOM];
    struct pcapng_reader reader = {.in_section = 1};
    struct pcapng_packet packet;
    struct sh_err err = {0};
    size_t used;
    const size_t len = pcapng_put_statistics(file, 3, INT64_C(0x123456789abcd), 1000, 7);
    assert_int_equal(pcapng_read(&reader, file, len, &packet, &used, &err), PCAPNG_OTHER);
    assert_true(used == len && len == 20 + 12 + 12 + 4 + 4);
    assert_true(rig_uint(file, 4) == 5 && rig_uint(file + 8, 4) == 3);
    assert_int_equal(rig_uint(file + 12, 4) << 32 | rig_uint(file + 16, 4), INT64_C(0x123456789abcd));
    assert_true(rig_uint(file + 20, 4) == (4 | 8 << 16) && rig_uint(file + 24, 8) == 1000);
    assert_true(rig_uint(file + 32, 4) == (7 | 8 << 16) && rig_uint(file + 36, 8) == 7);
}

/* The count of lost packets comes after the padded data. */
static void test_loss(void **state)
{
    (void)state;
    uint8_t file[256], with[256];
    struct pcapng_reader reader = {.in_section = 1, .n_interfaces = 1, .interface[0].resolution = 9};
    struct pcapng_packet packet;
    struct sh_err err = {0};
    size_t used;
    const int64_t t_ns = INT64_C(0x123456789abcdef); /* all bytes differ */
    const size_t plain = pcapng_put_packet(file, 0, t_ns, "abcde", 5, 0);
    const size_t len = pcapng_put_packet(with, 0, t_ns, "abcde", 5, 300);
    assert_true(plain == pcapng_packet_len(5) && len == plain + PCAPNG_LOST);
    assert_int_equal(pcapng_read(&reader, with, len, &packet, &used, &err), PCAPNG_PACKET);
    assert_true(used == len && packet.t_ns == t_ns && packet.len == 5 && memcmp(packet.data, "abcde", 5) == 0);
    assert_memory_equal(with + 8, file + 8, plain - 12);
    assert_true(rig_uint(with + 36, 4) == (4 | 8 << 16) && rig_uint(with + 40, 8) == 300);
    assert_int_equal(rig_uint(with + 48, 4), 0);
}

/* The option is code 14 with 8 bytes, seconds that are added to each time (draft-ietf-opsawg-pcapng, if_tsoffset). */
static void test_time_offset(void **state)
{
    (void)state;
    const uint64_t five = UINT64_C(5000000007);
    const struct {
        uint64_t ns;
        int64_t offset_s, t_ns;
    } cases[] = {{five, -2, INT64_C(3000000007)},
                 {five, 1700000000, INT64_C(1700000005000000007)},
                 {five, -6, INT64_C(-999999993)},
                 {five, INT64_C(9223372031), INT64_C(9223372036000000007)},
                 {five, INT64_C(9223372032), INT64_MAX}, /* beyond 292 years */
                 {five, INT64_MAX, INT64_MAX},
                 {five, INT64_MIN, INT64_MIN},
                 /* a clock that counts from 1601: 134,774 days more */
                 {UINT64_C(13344473600000000007), INT64_C(-134774) * 86400, INT64_C(1700000000000000007)}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        uint8_t file[512], option[12] = {14, 0, 8, 0};
        struct pcapng_reader reader = {0};
        struct pcapng_packet packet;
        struct sh_err err = {0};
        size_t used, at = pcapng_put_section(file, NULL), end = at + pcapng_put_interface(file + at, 1, 0, NULL, NULL);
        le_put64(option + 4, (uint64_t)cases[i].offset_s);
        memmove(file + at + 16 + sizeof option, file + at + 16, end - at - 16);
        memcpy(file + at + 16, option, sizeof option);
        end += sizeof option;
        le_put32(file + at + 4, (uint32_t)(end - at));
        le_put32(file + end - 4, (uint32_t)(end - at));
        end += pcapng_put_packet(file + end, 0, (int64_t)cases[i].ns, "x", 1, 0);
        for (at = 0; pcapng_read(&reader, file + at, end - at, &packet, &used, &err) == PCAPNG_OTHER;)
            at += used;
        assert_true(used > 0 && at + used == end);
        assert_int_equal(packet.t_ns, cases[i].t_ns);
    }
}

/* Other programs write microseconds, an unknown block, or a simple packet that is cut by the interface's limit. */
static void test_of_others(void **state)
{
    (void)state;
    uint8_t file[512];
    struct pcapng_reader reader = {0};
    struct pcapng_packet packet;
    struct sh_err err = {0};
    size_t used, at = pcapng_put_section(file, NULL), len = at;
    static const uint8_t interface[] = {1, 0, 0, 0, 20, 0, 0, 0, 1, 0, 0, 0, 4, 0, 0, 0, 20, 0, 0, 0};
    static const uint8_t unknown[] = {5, 0, 0, 0, 16, 0, 0, 0, 9, 9, 9, 9, 16, 0, 0, 0};
    static const uint8_t simple[] = {3, 0, 0, 0, 20, 0, 0, 0, 6, 0, 0, 0, 'a', 'b', 'c', 'd', 20, 0, 0, 0};
    memcpy(file + len, interface, sizeof interface);
    memcpy(file + len + sizeof interface, unknown, sizeof unknown);
    memcpy(file + len + sizeof interface + sizeof unknown, simple, sizeof simple);
    len += sizeof interface + sizeof unknown + sizeof simple;
    len += pcapng_put_packet(file + len, 0, 3000007, "x", 1, 0);
    assert_int_equal(pcapng_read(&reader, file, len, &packet, &used, &err), PCAPNG_OTHER);
    for (int i = 0; i < 2; i++, at += used)
        assert_int_equal(pcapng_read(&reader, file + at, len - at, &packet, &used, &err), PCAPNG_OTHER);
    assert_int_equal(pcapng_read(&reader, file + at, len - at, &packet, &used, &err), PCAPNG_PACKET);
    assert_true(!packet.has_time && packet.len == 4 && packet.original_len == 6);
    assert_memory_equal(packet.data, "abcd", 4);
    at += used;
    assert_int_equal(pcapng_read(&reader, file + at, len - at, &packet, &used, &err), PCAPNG_PACKET);
    assert_int_equal(packet.t_ns, INT64_C(3000007000)); /* microseconds, as the interface says nothing else */
    assert_int_equal(at + used, len);
    memcpy(file + 8, "\x1a\x2b\x3c\x4d", 4);
    assert_int_equal(pcapng_read(&(struct pcapng_reader){0}, file, len, &packet, &used, &err), SH_EFORMAT);
    assert_non_null(strstr(err.text, "big-endian"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_packets), cmocka_unit_test(test_disk_full),  cmocka_unit_test(test_read),
        cmocka_unit_test(test_damaged), cmocka_unit_test(test_of_others),  cmocka_unit_test(test_limits),
        cmocka_unit_test(test_bytes),   cmocka_unit_test(test_pcap),       cmocka_unit_test(test_statistics),
        cmocka_unit_test(test_loss),    cmocka_unit_test(test_time_offset)};
    return cmocka_run_group_tests(tests, rig_set_up, rig_tear_down);
}
