/* SPDX-License-Identifier: MIT */
#include "tests/unit/e57_rig.h"

enum { PAGE = 1024, CONTENT = 1020, MAX_STREAMS = 15 };

static uint8_t *content; /* without the CRCs */
static size_t content_len, physical_len;
char *e57rig_xml;

/* This CRC goes bit by bit, so that it shares nothing with the project's CRC: polynomial 0x1edc6f41, reflected. */
static uint32_t crc_bitwise(const uint8_t *p, size_t n)
{
    uint32_t crc = 0xffffffff;
    for (size_t i = 0; i < 8 * n; i++) {
        uint32_t bit = (uint32_t)(p[i / 8] >> i % 8) & 1;
        crc = (crc & 1) ^ bit ? crc >> 1 ^ 0x82f63b78 : crc >> 1;
    }
    return ~crc;
}

void e57rig_read(const char *path)
{
    uint8_t *file = rig_read(path, &physical_len);
    assert_int_equal(crc_bitwise((const uint8_t *)"123456789", 9), 0xe3069283); /* RFC 3720's check */
    assert_int_equal(physical_len % PAGE, 0);
    free(content);
    content = calloc(1, physical_len + 1);
    content_len = 0;
    for (size_t at = 0; at < physical_len; at += PAGE) {
        const uint8_t *crc = file + at + CONTENT;
        assert_int_equal(crc_bitwise(file + at, CONTENT),
                         (uint32_t)crc[0] << 24 | (uint32_t)crc[1] << 16 | (uint32_t)crc[2] << 8 | crc[3]);
        memcpy(content + content_len, file + at, CONTENT);
        content_len += CONTENT;
    }
    free(file);
    assert_memory_equal(content, "ASTM-E57", 8);
    assert_int_equal(rig_uint(content + 8, 4), 1);
    assert_int_equal(rig_uint(content + 12, 4), 0);
    assert_int_equal(rig_uint(content + 16, 8), physical_len);
    assert_int_equal(rig_uint(content + 40, 8), PAGE);
    size_t xml_at = rig_uint(content + 24, 8), xml_len = rig_uint(content + 32, 8);
    xml_at = xml_at / PAGE * CONTENT + xml_at % PAGE;
    assert_true(xml_at + xml_len <= content_len && content_len - xml_at - xml_len < CONTENT);
    for (size_t at = xml_at + xml_len; at < content_len; at++) /* the last page is filled up */
        assert_int_equal(content[at], 0);
    e57rig_xml = (char *)content + xml_at;
    e57rig_xml[xml_len] = 0;
    assert_memory_equal(e57rig_xml, "<?xml version=\"1.0\"", 19);
    assert_string_equal(e57rig_xml + xml_len - 11, "</e57Root>\n");
}

void e57rig_record_one(struct recorder_options options)
{
    struct sh_err err = {0};
    if (rig_record(rig_path("a.e57"), options, RIG_KEEP, &err) != SH_OK) fail_msg("%s", err.text);
    e57rig_read(rig_path("a.e57"));
    unlink(rig_path("a.e57"));
}

struct e57rig_record e57rig_record[8192];
size_t e57rig_n_records, e57rig_n_packets;

/* The streams of all packets joined, then cut into bits. */
static uint8_t stream[MAX_STREAMS][1 << 17];
static size_t stream_len[MAX_STREAMS];

static uint64_t bits(int s, size_t i, unsigned width)
{
    uint64_t v = 0;
    for (unsigned b = 0; b < width; b++) {
        size_t at = i * width + b;
        assert_true(at / 8 < stream_len[s]);
        v |= (uint64_t)(stream[s][at / 8] >> at % 8 & 1) << b;
    }
    return v;
}

static void read_packets(const uint8_t *section, unsigned n_streams)
{
    size_t len = rig_uint(section + 8, 8);
    memset(stream_len, 0, sizeof stream_len);
    e57rig_n_packets = 0;
    assert_int_equal(rig_uint(section, 8), 1); /* a compressed vector, and reserved bytes */
    for (const uint8_t *p = section + 32; p < section + len;) {
        const uint8_t *from = p + 6 + 2 * n_streams;
        size_t packet_len = rig_uint(p + 2, 2) + 1;
        assert_int_equal(p[0], 1);
        assert_int_equal(packet_len % 4, 0);
        assert_int_equal(rig_uint(p + 4, 2), n_streams);
        for (unsigned s = 0; s < n_streams; s++) {
            size_t n = rig_uint(p + 6 + 2 * s, 2);
            memcpy(stream[s] + stream_len[s], from, n);
            stream_len[s] += n;
            from += n;
        }
        assert_true(from <= p + packet_len && from + 4 > p + packet_len);
        p += packet_len;
        e57rig_n_packets++;
    }
}

void e57rig_scan(int k, int empty_shots, int coloured)
{
    char *at = e57rig_xml;
    unsigned long long offset, count, data;
    for (int i = 0; i <= k; i++)
        at = strstr(at, "<points type=\"CompressedVector\"") + 1;
    assert_int_equal(
        sscanf(at, "points type=\"CompressedVector\" fileOffset=\"%llu\" recordCount=\"%llu\"", &offset, &count), 2);
    size_t section = offset / PAGE * CONTENT + offset % PAGE;
    data = rig_uint(content + section + 16, 8);
    assert_int_equal(data / PAGE * CONTENT + data % PAGE, section + 32);
    read_packets(content + section, (empty_shots ? 12U : 11U) + (coloured ? 3U : 0U));
    e57rig_n_records = count;
    for (size_t i = 0; i < count; i++) {
        struct e57rig_record *r = &e57rig_record[i];
        int s = 3;
        double *xyz[3] = {&r->x, &r->y, &r->z};
        for (int axis = 0; axis < 3; axis++)
            *xyz[axis] = ((double)bits(axis, i, 32) - 2147483648.0) * 1e-3;
        r->invalid = empty_shots ? (unsigned)bits(s++, i, 2) : 0;
        r->intensity = ((double)bits(s++, i, 16) - 32768) / 100;
        r->no_intensity = (unsigned)bits(s++, i, 1);
        for (int c = 0; c < 3 && coloured; c++)
            r->rgb[c] = (uint8_t)bits(s++, i, 8);
        uint64_t t = bits(s++, i, 64);
        memcpy(&r->t_s, &t, 8);
        r->echo = (unsigned)bits(s++, i, 4);
        r->echoes = (unsigned)bits(s++, i, 4);
        r->row = (uint32_t)bits(s++, i, 32);
        r->column = (uint32_t)bits(s++, i, 32);
        r->label = (unsigned)bits(s++, i, 16);
    }
}

double e57rig_number(const char *from, const char *tag)
{
    char open[64];
    snprintf(open, sizeof open, "<%s type=\"", tag);
    const char *at = strstr(from, open);
    if (at == NULL) fail_msg("no %s", tag);
    return strtod(strchr(at, '>') + 1, NULL);
}

void e57rig_free(void)
{
    free(content);
    content = NULL;
}
