/* SPDX-License-Identifier: MIT */
#include "tests/unit/native_stream.h"

uint8_t stream[STREAM_MAX];
size_t stream_len;
struct piece piece[ITEMS_MAX];
int n_pieces;
static uint32_t next_seq;

static void add_frame(size_t len)
{
    next_seq = (stream[stream_len + 3] & NATIVE_LOCAL) != 0 ? next_seq : next_seq + 1;
    native_finish_frame(stream + stream_len, (stream[stream_len + 3] & NATIVE_LOCAL) != 0 ? 0 : next_seq - 1);
    /* a frame that ends like the next begins can't be told from one that lost its first byte */
    assert_int_not_equal(stream[stream_len + len - 1], NATIVE_SYNC);
    piece[n_pieces++] = (struct piece){stream_len, len, 0};
    stream_len += len;
}

static void add_text(const char *text)
{
    size_t len = strlen(text);
    memcpy(stream + stream_len, text, len);
    piece[n_pieces++] = (struct piece){stream_len, len, 1};
    stream_len += len;
}

static void add_points(uint32_t n, uint32_t salt)
{
    struct line_block block = make_block(n);
    block.n_pulses = n;
    for (uint32_t i = 0; i < n; i++) {
        /* payloads full of sync bytes and of text */
        block_a[i] = 0xd5d5d5d5u;
        block_b[i] = 0x0a0d4b4fu;
        block_c[i] = salt * 2654435761u + i;
        block_refl[i] = (int16_t)salt;
        block_label[i] = 0x03d5;
        block_dt[i] = i;
        block_echo[i] = 0x11;
    }
    add_frame(native_encode_points(stream + stream_len, STREAM_MAX - stream_len, &block, (int64_t)salt));
}

void make_stream(void)
{
    stream_len = 0;
    n_pieces = 0;
    next_seq = UINT32_MAX - 4;
    struct native_descriptor d = make_descriptor();
    struct native_anchor a = make_anchor();
    struct native_telemetry t = {.state = 4, .pulses = 0xd5d5};
    struct native_event e = {.code = NATIVE_EV_SCAN_START, .a = 1, .text = "OK\r\n\xd5"};
    struct line_end end = {.line = 0xd5, .n_cast = 5};
    struct native_names labels = {0, 1, name_of, NULL};
    strcpy(names[0], "wall");
#define AT stream + stream_len, STREAM_MAX - stream_len
    add_text("Maker,Model,SN1,1.0\r\n");
    add_frame(native_encode_surfaces(AT, 4096, &labels, 1));
    add_frame(native_encode_descriptor(AT, &d, 1, 0));
    add_frame(native_encode_anchor(AT, &a, 1, 0));
    add_text("OK\r\n");
    add_frame(native_encode_event(AT, &e, 2, 0));
    add_points(3, 1);
    add_points(0, 2);
    add_text("ERR -222,\"Data out of range\"\r\n");
    add_text("1\r\n");
    add_points(5, 3);
    add_frame(native_encode_line_end(AT, &end, 5));
    add_frame(native_encode_event(AT, &e, 6, NATIVE_LOCAL));
    add_frame(native_encode_descriptor(AT, &d, 7, NATIVE_REPEAT));
    add_text("0\r\n");
    add_frame(native_encode_anchor(AT, &a, 7, NATIVE_REPEAT));
    add_points(2, 4);
    add_frame(native_encode_telemetry(AT, &t, 8, 0));
}

struct native_parser parser;
struct got got[ITEMS_MAX];
int n_got, n_texts;

static void collect(void)
{
    enum native_item item;
    while ((item = native_parser_next(&parser)) != NATIVE_MORE) {
        assert_true(n_got < ITEMS_MAX);
        if (item == NATIVE_TEXT) {
            n_texts++;
            continue;
        }
        got[n_got].len = NATIVE_HEADER_LEN + (size_t)parser.header.length;
        assert_true(got[n_got].len <= sizeof got[0].bytes);
        assert_ptr_equal(parser.payload, parser.frame + NATIVE_HEADER_LEN);
        memcpy(got[n_got++].bytes, parser.frame, NATIVE_HEADER_LEN + (size_t)parser.header.length);
    }
}

void feed(const uint8_t *data, size_t len, size_t chunk)
{
    while (len > 0) {
        size_t room, n = chunk < len ? chunk : len;
        uint8_t *to = native_parser_room(&parser, &room);
        assert_true(room > 0);
        if (n > room) n = room;
        memcpy(to, data, n);
        native_parser_added(&parser, n);
        collect();
        data += n;
        len -= n;
    }
}

void begin(void)
{
    native_parser_init(&parser);
    n_got = n_texts = 0;
}

void finish(void)
{
    native_parser_finish(&parser);
    collect();
}

void check_got(size_t hurt_from, size_t hurt_to)
{
    int k = 0;
    for (int i = 0; i < n_pieces; i++) {
        if (piece[i].is_text || (piece[i].at < hurt_to && hurt_from < piece[i].at + piece[i].len)) continue;
        assert_true(k < n_got);
        assert_int_equal(got[k].len, piece[i].len);
        assert_memory_equal(got[k].bytes, stream + piece[i].at, piece[i].len);
        k++;
    }
    assert_int_equal(n_got, k);
}
