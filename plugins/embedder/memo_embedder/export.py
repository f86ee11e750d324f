"""Exporting a model to ONNX, once. Run in a separate process, because torch costs seconds and half a gigabyte."""

from __future__ import annotations

import argparse
import os
from pathlib import Path

import numpy as np

FORMAT = 1  # counts changes of what is written, part of the cache's path
_PROBES = ("open", "Pull the handle of the microwave along an arc about its hinge, not straight back. " * 3)


def export(model: Path, target: Path, max_tokens: int) -> float:
    """Write the model in ``model`` to ``target`` with mean pooling and normalisation built in.

    Inputs ``input_ids`` and ``attention_mask``, int64, shape (texts, tokens); output ``sentence_vector``, float32, unit
    vectors. Returns the largest deviation from torch on two texts of different length. Raises what torch raises.
    """
    os.environ["HF_HUB_OFFLINE"] = "1"
    import onnxruntime
    import torch
    from tokenizers import Tokenizer
    from transformers import AutoModel

    class Sentence(torch.nn.Module):
        def __init__(self) -> None:
            super().__init__()
            self.transformer = AutoModel.from_pretrained(str(model), attn_implementation="eager").eval()

        def forward(self, input_ids: torch.Tensor, attention_mask: torch.Tensor) -> torch.Tensor:
            segments = torch.zeros_like(input_ids)  # the model's own default is traced with the example's length
            tokens = self.transformer(
                input_ids=input_ids, attention_mask=attention_mask, token_type_ids=segments
            ).last_hidden_state
            mask = attention_mask.unsqueeze(-1).to(tokens.dtype)
            mean = (tokens * mask).sum(dim=1) / mask.sum(dim=1).clamp(min=1e-9)
            return torch.nn.functional.normalize(mean, p=2.0, dim=1)

    sentence = Sentence()
    ids = torch.arange(1000, 1016).reshape(2, 8)
    attention = torch.ones(
        (2, 8), dtype=torch.int64
    )  # not the tensor of the ids: one tensor twice is traced as one input
    shape = {0: torch.export.Dim("texts", max=1024), 1: torch.export.Dim("tokens", max=512)}
    with torch.no_grad():
        torch.onnx.export(
            sentence,
            (ids, attention),
            str(target),
            input_names=["input_ids", "attention_mask"],
            output_names=["sentence_vector"],
            dynamic_shapes={"input_ids": shape, "attention_mask": shape},
            dynamo=True,
            external_data=False,
            verbose=False,
        )
    session = onnxruntime.InferenceSession(str(target), providers=["CPUExecutionProvider"])
    tokenizer = Tokenizer.from_file(str(model / "tokenizer.json"))
    tokenizer.no_padding()
    tokenizer.enable_truncation(max_tokens)
    deviation = 0.0
    for text in _PROBES:
        encoded = np.array([tokenizer.encode(text).ids], dtype=np.int64)
        mask = np.ones_like(encoded)
        found = session.run(None, {"input_ids": encoded, "attention_mask": mask})[0]
        with torch.no_grad():
            wanted = sentence(torch.from_numpy(encoded), torch.from_numpy(mask)).numpy()
        deviation = max(deviation, float(np.abs(found - wanted).max()))
    return deviation


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("model", type=Path)
    parser.add_argument("target", type=Path)
    parser.add_argument("--max-tokens", type=int, default=256)
    arguments = parser.parse_args()
    deviation = export(arguments.model, arguments.target, arguments.max_tokens)
    if not deviation < 1e-5:
        raise SystemExit(f"the export deviates from torch by {deviation:.2g}")


if __name__ == "__main__":
    main()
