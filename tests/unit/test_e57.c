/* E57 files by a small reader of their own: pages, sections, packets and bit streams as ASTM E2807 has them. */
#include "tests/unit/recorder_rig.h"

enum { PAGE = 1024, CONTENT = 1020, MAX_STREAMS = 15 };

static uint8_t *content; /* without the CRCs */
static size_t content_len, physical_len;
static char *xml;

/* Bit by bit, so that it shares nothing with the project's CRC: polynomial 0x1edc6f41, reflected. */
static uint32_t crc_bitwise(const uint8_t *p, size_t n)
{
    uint32_t crc = 0xffffffff;
    for (size_t i = 0; i < 8 * n; i++) {
        uint32_t bit = (uint32_t)(p[i / 8] >> i % 8) & 1;
        crc = (crc & 1) ^ bit ? crc >> 1 ^ 0x82f63b78 : crc >> 1;
    }
    return ~crc;
}

/* Checks and strips the CRCs, finds the XML. */
static void read_pages(const char *path)
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
    xml = (char *)content + xml_at;
    xml[xml_len] = 0;
    assert_memory_equal(xml, "<?xml version=\"1.0\"", 19);
    assert_string_equal(xml + xml_len - 11, "</e57Root>\n");
}

static int coloured; /* by label */

static void record_e57(int empty_shots)
{
    struct sh_err err = {0};
    const char *path = rig_path("a.e57");
    const struct colour_choice colour = {.given = coloured, .scale.mode = COLOUR_LABEL};
    int rc = rig_record(path, (struct recorder_options){.empty_shots = empty_shots, .colour = colour}, 1, &err);
    if (rc != 0) fail_msg("%s", err.text);
    read_pages(path);
    unlink(path);
}

struct record {
    double x, y, z, intensity, t_s;
    unsigned invalid, no_intensity, echo, echoes;
    uint32_t row, column;
    unsigned label;
    uint8_t rgb[3]; /* where there are colours */
};
static struct record record[8192];
static size_t n_records;

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
    }
}

/* Scan k of the file, by what the XML says of it. */
static void read_scan(int k, int empty_shots)
{
    char *at = xml;
    unsigned long long offset, count, data;
    for (int i = 0; i <= k; i++)
        at = strstr(at, "<points type=\"CompressedVector\"") + 1;
    assert_int_equal(
        sscanf(at, "points type=\"CompressedVector\" fileOffset=\"%llu\" recordCount=\"%llu\"", &offset, &count), 2);
    size_t section = offset / PAGE * CONTENT + offset % PAGE;
    data = rig_uint(content + section + 16, 8);
    assert_int_equal(data / PAGE * CONTENT + data % PAGE, section + 32);
    read_packets(content + section, (empty_shots ? 12U : 11U) + (coloured ? 3U : 0U));
    n_records = count;
    for (size_t i = 0; i < count; i++) {
        struct record *r = &record[i];
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

static double number(const char *from, const char *tag)
{
    char open[64];
    snprintf(open, sizeof open, "<%s type=\"", tag);
    const char *at = strstr(from, open);
    if (at == NULL) fail_msg("no %s", tag);
    return strtod(strchr(at, '>') + 1, NULL);
}

static const struct rig_point points[] = {
    {3000, -4000, 12000, -1234, 7, 1, 2},
    {3001, -4001, 12001, INT16_MIN, 8, 2, 2},
    {0, 0, 0, INT16_MIN, 0xffff, 0, 0},
    {0, 0, -5000, 32767, 9, 1, 1},
    {5, 0, 0, 0, 1, 1, 1},
};

/* On the central meridian the grid's axes are the scene's, so the head sees x = -y and y = x of the differences. */
static void check_points(size_t first, int empty_shots, uint32_t column, uint32_t row)
{
    for (int i = 0, pulse = -1; i < 5; i++) {
        const struct rig_point *want = &points[i];
        if (want->echo <= 1) pulse++;
        if (want->count == 0 && !empty_shots) continue;
        const struct record *r = &record[first++];
        assert_int_equal(r->invalid, want->count == 0 ? 2 : 0);
        assert_true(fabs(r->x - -1e-3 * want->b) < 1e-9 || want->count == 0);
        assert_true(fabs(r->y - 1e-3 * want->a) < 1e-9 || want->count == 0);
        assert_true(fabs(r->z - 1e-3 * want->c) < 1e-9 || want->count == 0);
        assert_int_equal(r->no_intensity, want->refl_cdb == INT16_MIN);
        if (!r->no_intensity) assert_true(fabs(r->intensity - want->refl_cdb / 100.0) < 1e-9);
        assert_int_equal(r->echo, want->echo > 0 ? want->echo - 1 : 0); /* counted from 0 */
        assert_int_equal(r->echoes, want->count);
        assert_int_equal(r->column, column);
        assert_int_equal(r->label, want->label);
        assert_int_equal(r->row, row + (uint32_t)pulse);
    }
}

static void test_scans(void **state)
{
    (void)state;
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_UTM, 32632, 2), b = rig_anchor_of(NATIVE_CRS_UTM, 32632, 3);
    b.anchor[0] += 7;
    for (int empty_shots = 0; empty_shots < 2; empty_shots++) {
        size_t each = empty_shots ? 5 : 4;
        rig_begin();
        rig_descriptor(1, 1);
        rig_anchor(&a);
        rig_points(0, 0, 6, points, 5);
        rig_points(1, 20, 27, points, 5);
        rig_descriptor(1, 2);
        rig_anchor(&b);
        rig_points(0, 0, 9, points, 5);
        record_e57(empty_shots);
        read_scan(0, empty_shots);
        assert_int_equal(n_records, 2 * each);
        check_points(0, empty_shots, 0, 6);
        check_points(each, empty_shots, 1, 7);
        assert_true(fabs(record[each].t_s - 0.027) < 1e-12);
        read_scan(1, empty_shots);
        assert_int_equal(n_records, each);
        check_points(0, empty_shots, 0, 9);
    }
}

static void test_xml(void **state)
{
    (void)state;
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_UTM, 32632, 2);
    rig_begin();
    rig_descriptor(1, 1);
    rig_anchor(&a);
    rig_points(3, 0, 6, points, 5);
    record_e57(0);
    assert_non_null(strstr(xml, "AUTHORITY[\"EPSG\",\"32632\"]"));
    assert_non_null(strstr(xml, "Maker,&#60;Model&#62; &#38; Co,SN1,1.0"));
    assert_non_null(strstr(xml, "scan 1, station 2"));
    /* a quarter turn clockwise about z, seen from above: minus 90 degrees */
    static const double want[4] = {M_SQRT1_2, 0, 0, -M_SQRT1_2};
    static const char *const name[4] = {"w", "x", "y", "z"};
    const char *shift = strstr(xml, "<translation"), *turn = strstr(xml, "<rotation");
    for (int i = 0; i < 4; i++)
        assert_true(fabs(number(turn, name[i]) - want[i]) < 1e-15);
    for (int i = 0; i < 3; i++)
        assert_true(number(shift, name[i + 1]) == a.anchor[i]);
    assert_true(fabs(number(xml, "xMinimum")) < 1e-9 && fabs(number(xml, "xMaximum") - 4.001) < 1e-9);
    assert_true(fabs(number(xml, "yMinimum")) < 1e-9 && fabs(number(xml, "yMaximum") - 3.001) < 1e-9);
    assert_true(fabs(number(xml, "zMinimum") + 5) < 1e-9 && fabs(number(xml, "zMaximum") - 12.001) < 1e-9);
    assert_true(number(xml, "intensityMinimum") == -12.34 && number(xml, "intensityMaximum") == 327.67);
    assert_true(number(xml, "rowMinimum") == 6 && number(xml, "rowMaximum") == 9);
    assert_true(number(xml, "columnMinimum") == 3 && number(xml, "columnMaximum") == 3);
    assert_true(number(xml, "returnMaximum") == 1);
    assert_null(strstr(xml, "creationDateTime")); /* no clock in this stream */
}

/* More records than a packet holds, with streams of one, two and four bits across its edge. */
static void test_packets(void **state)
{
    (void)state;
    static struct rig_point many[3000];
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_UTM, 32632, 1);
    for (int i = 0; i < 3000; i++)
        many[i] = i % 7 == 3 ? (struct rig_point){0, 0, 0, INT16_MIN, 0xffff, 0, 0}
                             : (struct rig_point){i, -i, 2 * i, (int16_t)(i % 5 ? i : INT16_MIN), 1, 1, 1};
    rig_begin();
    rig_descriptor(1, 1);
    rig_anchor(&a);
    rig_points(0, 0, 0, many, 3000);
    rig_points(1, 3000, 3000, many, 1001);
    record_e57(1);
    read_scan(0, 1);
    assert_int_equal(n_records, 4001);
    for (int i = 0; i < 4001; i++) {
        int k = i % 3000;
        const struct record *r = &record[i];
        assert_int_equal(r->invalid, k % 7 == 3 ? 2 : 0);
        assert_int_equal(r->row, k);
        assert_int_equal(r->column, i / 3000);
        assert_int_equal(r->echoes, k % 7 != 3);
        if (r->invalid) continue;
        assert_int_equal(r->no_intensity, k % 5 == 0);
        assert_true(fabs(r->z - 2e-3 * k) < 1e-9);
    }
}

/* The colours of a record beside its label, over the edges of packets, and what the XML says of them. */
static void test_colours(void **state)
{
    (void)state;
    static struct rig_point many[4000];
    static const char *const name[] = {"<colorRed type=\"Integer\" minimum=\"0\" maximum=\"255\">", "<colorGreen type",
                                       "<colorBlue type"};
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_UTM, 32632, 1);
    for (int i = 0; i < 4000; i++)
        many[i] = i % 7 == 3 ? (struct rig_point){0, 0, 0, INT16_MIN, 0xffff, 0, 0}
                             : (struct rig_point){i, -i, 2 * i, 0, (uint16_t)(i % 50), 1, 1};
    rig_begin();
    rig_descriptor(1, 1);
    rig_anchor(&a);
    rig_points(0, 0, 0, many, 3000);
    rig_points(1, 3000, 3000, many + 3000, 1000);
    coloured = 1;
    record_e57(1);
    read_scan(0, 1);
    coloured = 0;
    assert_int_equal(n_records, 4000);
    for (int i = 0; i < 4000; i++) {
        uint8_t rgb[3] = {128, 128, 128};
        assert_int_equal(record[i].label, many[i].label);
        if (many[i].count != 0) colour_number(many[i].label, rgb);
        assert_memory_equal(record[i].rgb, rgb, 3);
        assert_int_equal(record[i].invalid, many[i].count == 0 ? 2 : 0);
    }
    for (int i = 0; i < 3; i++)
        assert_non_null(strstr(xml, name[i]));
    assert_true(strstr(xml, name[0]) < strstr(xml, name[1]) && strstr(xml, name[1]) < strstr(xml, name[2]));
    assert_true(number(xml, "colorRedMinimum") == 0 && number(xml, "colorBlueMaximum") == 255);
}

static void test_no_points(void **state)
{
    (void)state;
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_UTM, 32632, 1);
    static const struct rig_point empty = {0, 0, 0, INT16_MIN, 0xffff, 0, 0};
    rig_begin();
    record_e57(0); /* not even a scan */
    assert_null(strstr(xml, "<points"));
    rig_begin();
    rig_descriptor(1, 1);
    rig_anchor(&a);
    rig_points(0, 0, 0, &empty, 1);
    record_e57(0);
    read_scan(0, 0);
    assert_int_equal(n_records, 0);
    assert_null(strstr(xml, "cartesianBounds"));
}

static void test_same_bytes(void **state)
{
    (void)state;
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_UTM, 32632, 1);
    char guid[2][64];
    for (int i = 0; i < 3; i++) {
        rig_begin();
        rig_descriptor(1, 1);
        rig_anchor(&a);
        rig_points(0, 0, 0, points, i < 2 ? 5 : 4);
        record_e57(0);
        char *at = strstr(strstr(xml, "<data3D"), "<guid type=\"String\">{") + 21;
        if (i < 2) snprintf(guid[i], sizeof guid[i], "%.36s", at);
        if (i == 2) assert_memory_not_equal(guid[0], at, 36);
    }
    assert_string_equal(guid[0], guid[1]);
}

static void test_disk_full(void **state)
{
    (void)state;
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_UTM, 32632, 1);
    rig_begin();
    rig_descriptor(1, 1);
    rig_anchor(&a);
    for (uint32_t i = 0; i < 20; i++)
        rig_points(i, 10 * i, 10 * i, points, 5);
    rig_check_disk_full(rig_path("full.e57"), 3000);
}

static int tear_down(void **state)
{
    free(content);
    return rig_tear_down(state);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_scans),     cmocka_unit_test(test_xml),        cmocka_unit_test(test_packets),
        cmocka_unit_test(test_no_points), cmocka_unit_test(test_same_bytes), cmocka_unit_test(test_disk_full),
        cmocka_unit_test(test_colours),
    };
    return cmocka_run_group_tests(tests, rig_set_up, tear_down);
}
