"""Tiny models with random weights, saved as a user's would be: they load and run, and know nothing."""

from __future__ import annotations

import json
import string

import torch
import transformers as hf

LETTERS = string.ascii_lowercase


def _clip_tokenizer(folder):
    """Knows letters, and no merges of them."""
    vocabulary = {token: i for i, token in enumerate([*LETTERS, *(f"{c}</w>" for c in LETTERS)])}
    vocabulary |= {"<|startoftext|>": len(vocabulary), "<|endoftext|>": len(vocabulary) + 1}
    (folder / "vocab.json").write_text(json.dumps(vocabulary))
    (folder / "merges.txt").write_text("#version: 0.2\n")
    tokenizer = hf.CLIPTokenizer(str(folder / "vocab.json"), str(folder / "merges.txt"))
    return tokenizer, len(vocabulary)


def owl(folder):
    torch.manual_seed(0)
    folder.mkdir()
    tokenizer, words = _clip_tokenizer(folder)
    small = {"hidden_size": 32, "intermediate_size": 32, "num_hidden_layers": 1, "num_attention_heads": 2}
    ends = {"bos_token_id": words - 2, "eos_token_id": words - 1, "pad_token_id": 0}
    config = hf.Owlv2Config(
        text_config={**small, "vocab_size": words, "max_position_embeddings": 64, **ends},
        vision_config={**small, "image_size": 64, "patch_size": 16},
        projection_dim=32,
    )
    hf.Owlv2ForObjectDetection(config).save_pretrained(folder)
    images = hf.Owlv2ImageProcessorPil(size={"height": 64, "width": 64})
    hf.Owlv2Processor(images, tokenizer).save_pretrained(folder)
    return folder


def dino(folder):
    torch.manual_seed(0)
    folder.mkdir()
    tokens = ["[PAD]", "[UNK]", "[CLS]", "[SEP]", "[MASK]", ".", *LETTERS, *(f"##{c}" for c in LETTERS), "cup", "can"]
    (folder / "vocab.txt").write_text("\n".join(tokens))
    tokenizer = hf.BertTokenizer(str(folder / "vocab.txt"))
    backbone = hf.SwinConfig(
        image_size=64, embed_dim=8, depths=[1, 1, 1, 1], num_heads=[1, 1, 2, 2], window_size=4, out_indices=[2, 3, 4]
    )
    text = hf.BertConfig(
        vocab_size=len(tokens), hidden_size=16, num_hidden_layers=1, num_attention_heads=2, intermediate_size=16
    )
    config = hf.GroundingDinoConfig(
        backbone_config=backbone,
        text_config=text,
        d_model=32,
        num_queries=10,
        encoder_layers=1,
        decoder_layers=2,
        encoder_ffn_dim=16,
        decoder_ffn_dim=16,
        encoder_attention_heads=2,
        decoder_attention_heads=2,
        num_feature_levels=3,
    )
    hf.GroundingDinoForObjectDetection(config).save_pretrained(folder)
    images = hf.GroundingDinoImageProcessorPil(size={"shortest_edge": 64, "longest_edge": 96})
    hf.GroundingDinoProcessor(images, tokenizer).save_pretrained(folder)
    return folder


def sam2(folder):
    torch.manual_seed(0)
    hiera = hf.Sam2HieraDetConfig(
        hidden_size=8,
        num_attention_heads=1,
        blocks_per_stage=[1, 1, 2, 1],
        embed_dim_per_stage=[8, 16, 32, 64],
        num_attention_heads_per_stage=[1, 1, 2, 2],
        window_size_per_stage=[4, 4, 4, 4],
        global_attention_blocks=[3],
        image_size=[128, 128],
    )
    vision = hf.Sam2VisionConfig(
        backbone_config=hiera,
        backbone_channel_list=[64, 32, 16, 8],
        backbone_feature_sizes=[[32, 32], [16, 16], [8, 8]],
        fpn_hidden_size=32,
    )
    config = hf.Sam2Config(
        vision_config=vision,
        prompt_encoder_config={"image_size": 128, "hidden_size": 32},
        mask_decoder_config={
            "hidden_size": 32,
            "mlp_dim": 32,
            "num_attention_heads": 2,
            "iou_head_hidden_dim": 16,
            "num_hidden_layers": 2,
        },
    )
    hf.Sam2Model(config).save_pretrained(folder)
    return folder


def sam3(folder):
    torch.manual_seed(0)
    folder.mkdir()
    tokenizer, words = _clip_tokenizer(folder)
    small = {"hidden_size": 32, "intermediate_size": 32, "num_attention_heads": 2}
    vision = {
        "backbone_config": hf.Sam3ViTConfig(
            **small, num_hidden_layers=1, image_size=112, patch_size=14, window_size=4, pretrain_image_size=56
        ),
        "fpn_hidden_size": 32,
        "backbone_feature_sizes": [[32, 32], [16, 16], [8, 8]],
    }
    ends = {"bos_token_id": words - 2, "eos_token_id": words - 1, "pad_token_id": 0}
    config = hf.Sam3Config(
        vision_config=vision,
        text_config={
            **small, "num_hidden_layers": 1, "vocab_size": words, "projection_dim": 32, "max_position_embeddings": 32,
            "model_type": "clip_text_model", **ends,
        },
        geometry_encoder_config={**small, "num_layers": 1},
        detr_encoder_config={**small, "num_layers": 1},
        detr_decoder_config={**small, "num_layers": 1, "num_queries": 6},
        mask_decoder_config={"hidden_size": 32, "num_attention_heads": 2},
    )  # fmt: skip
    hf.Sam3Model(config).save_pretrained(folder)
    tokenizer.save_pretrained(folder)
    return folder
